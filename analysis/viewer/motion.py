"""Selection and display of re-simulated robots."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from analysis.viewer.body import BoxModel, place_rows
from analysis.viewer.entities import TimePoint, motion_path
from analysis.viewer.recording import Recording, ViewerError
from schema.robot.ids import BirthId
from schema.tables.files import read_table
from schema.wire.updates import individual

LANE_M = 0.8
LANES = 4
"""Robots that were simulated alone are shown side by side: distance [m], and robots
per row."""


@dataclass(frozen=True, slots=True)
class Motion:
    """Motion of a re-simulated robot, and a line of text that compares it."""

    birth: BirthId
    poses: pa.Table
    verdict: str


def selected_robots(
    folder: Path, wanted: Iterable[BirthId], *, has_ancestry: bool
) -> list[BirthId]:
    """Return the robots of ``--robot``, each once, in their order.

    Args:
        folder: the run folder.
        wanted: robots named by the user.
        has_ancestry: add the first parent of each robot, its first parent, and so on,
            back to a founder.

    Raises:
        ViewerError: no robot of that name was born.
    """
    births = read_table(folder, "births").select(["island", "birth", "parents"])
    rows = (row.values() for row in births.to_pylist())
    parents = {BirthId(island, birth): couple for island, birth, couple in rows}
    found: dict[BirthId, None] = {}
    for birth in wanted:
        if birth not in parents:
            raise ViewerError(f"--robot {birth.name}: no robot of that name was born")
        found[birth] = None
        last = birth
        while has_ancestry and parents[last]:
            first = parents[last][0]
            last = BirthId(first["island"], first["birth"])
            found[last] = None
    return list(found)


def best_evaluated(folder: Path) -> tuple[BirthId, int, float]:
    """Return the fittest robot that a run ever evaluated, the first of equal ones.

    The robot may be dead, and is then fitter than the best of the last population.

    Args:
        folder: the run folder.

    Returns:
        The robot, the island on which it had its fitness, and the fitness [m/s].

    Raises:
        ViewerError: no robot was evaluated.
    """
    alone = read_table(folder, "evaluations")
    together = read_table(folder, "fitness")
    judged = (alone, together.filter(together["is_mature"]))
    rows = pa.concat_tables(judged, promote_options="default")
    best = pc.max(rows["fitness"]).as_py()
    if best is None:
        raise ViewerError(f"{folder}: no robot has been evaluated yet")
    (row,) = rows.filter(pc.equal(rows["fitness"], best)).slice(0, 1).to_pylist()
    return individual(row), row["island"], best


def show_motion(
    recording: Recording, motion: Motion, model: BoxModel, lane: int | None
) -> None:
    """Show the motion of a robot.

    Args:
        recording: recording to log to.
        motion: motion of the robot.
        model: model of the robot.
        lane: lane that it is shown in, from 0; None shows it at its recorded place.
    """
    path = motion_path(motion.birth)
    times = motion.poses["sim_time_s"].to_numpy()
    centres, attitudes = place_rows(model, motion.poses)
    if lane is not None:
        row, column = divmod(lane, LANES)
        centres[..., :2] += LANE_M * np.array([column, row], dtype=np.float32)
    start = TimePoint(float(times[0]))
    recording.log_boxes(path, model, start)
    recording.log_poses(path, times, None, centres, attitudes)
    recording.log_line(motion.verdict, start, "INFO")
