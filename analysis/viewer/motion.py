"""Robots that are shown by themselves, in full motion: who, and how."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from analysis.viewer.body import BoxModel, place_rows
from analysis.viewer.entities import PoseBatch, TimePoint, motion_path
from analysis.viewer.recording import Recording, ViewerError
from schema.robot.ids import BirthId
from schema.tables.files import read_table
from schema.wire.updates import individual

LANE_M = 0.8
LANES = 4
"""Robots that moved alone are shown side by side, so far apart [m], so many a row."""


@dataclass(frozen=True, slots=True)
class Motion:
    """How a robot moved, and a line that tells whether it is what was recorded."""

    birth: BirthId
    poses: pa.Table
    verdict: str


def chosen(
    folder: Path, wanted: Iterable[BirthId], *, has_ancestry: bool
) -> list[BirthId]:
    """Return the robots of ``--robot``, each once, in their order.

    Args:
        folder: of the run.
        wanted: who.
        has_ancestry: with each its first parent, and so on, back to a founder.

    Raises:
        ViewerError: nobody of that name was born.
    """
    births = read_table(folder, "births").select(["island", "birth", "parents"])
    parents = {
        BirthId(row["island"], row["birth"]): row["parents"]
        for row in births.to_pylist()
    }
    found: dict[BirthId, None] = {}
    for birth in wanted:
        if birth not in parents:
            name = name_of(birth)
            raise ViewerError(f"--robot {name}: nobody of that name was born")
        found[birth] = None
        last = birth
        while has_ancestry and parents[last]:
            first = parents[last][0]
            last = BirthId(first["island"], first["birth"])
            found[last] = None
    return list(found)


def best_evaluated(folder: Path) -> tuple[BirthId, float]:
    """Return the fittest of all that a run ever judged, the first of equals.

    It may have died since: the best of the last population is another, then.

    Args:
        folder: of the run.

    Returns:
        Who, and its fitness [m/s].

    Raises:
        ViewerError: nobody was judged.
    """
    alone = read_table(folder, "evaluations")
    together = read_table(folder, "fitness")
    judged = (alone, together.filter(together["is_mature"]))
    found = [(pc.max(rows["fitness"]).as_py(), rows) for rows in judged]
    known = [(best, rows) for best, rows in found if best is not None]
    if not known:
        raise ViewerError(f"{folder}: nobody has been judged yet")
    best, rows = max(known, key=lambda one: one[0])
    (row,) = rows.filter(pc.equal(rows["fitness"], best)).slice(0, 1).to_pylist()
    return individual(row), best


def show_motion(
    recording: Recording, motion: Motion, box_model: BoxModel, lane: int | None
) -> None:
    """Show how a robot moved.

    Args:
        recording: to fill.
        motion: of the robot.
        box_model: its body.
        lane: which lane it is shown in, from 0; where it was if None.
    """
    path = motion_path(motion.birth)
    times = motion.poses["sim_time_s"].to_numpy()
    centres, attitudes = place_rows(box_model, motion.poses)
    if lane is not None:
        row, column = divmod(lane, LANES)
        centres[..., :2] += LANE_M * np.array([column, row], dtype=np.float32)
    recording.born(path, box_model, TimePoint(float(times[0])))
    recording.moved(path, PoseBatch(times, None, centres, attitudes))
    recording.said(motion.verdict, TimePoint(float(times[0])), "INFO")


def name_of(birth: BirthId) -> str:
    """Return how an individual is called: ISLAND:BIRTH."""
    return f"{birth.island}:{birth.number}"
