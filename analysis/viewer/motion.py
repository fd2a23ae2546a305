"""Selection and display of re-simulated robots."""

from collections.abc import Iterable
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pyarrow as pa

from analysis.viewer.body import BoxModel, place_rows
from analysis.viewer.entities import TimePoint, motion_path
from analysis.viewer.flags import BEST
from analysis.viewer.recording import Recording, ViewerError
from schema.errors import rounded
from schema.robot.ids import BirthId
from schema.tables.files import read_table
from schema.tables.last_populations import best_ever, best_of, last_populations
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

    With ancestry the first parent of each robot, its first parent, and so on, back to a
    founder, are added.

    Raises:
        ViewerError: no robot of that name was born.
    """
    births = read_table(folder, "births", ["island", "birth", "parents"])
    rows = (row.values() for row in births.to_pylist())
    parents = {BirthId(island, birth): couple for island, birth, couple in rows}
    selected: dict[BirthId, None] = {}
    for birth in wanted:
        if birth not in parents:
            raise ViewerError(f"--robot {birth.name}: no robot of that name was born")
        selected[birth] = None
        last = birth
        while has_ancestry and parents[last]:
            first = parents[last][0]
            last = BirthId(first["island"], first["birth"])
            selected[last] = None
    return list(selected)


def named_robot(folder: Path, name: str) -> tuple[BirthId, str]:
    """Return the robot that ``--robot`` names, and a line about it.

    Raises:
        ViewerError: no robot was evaluated.
    """
    if name == BEST:
        what, row = "best of the last population", best_of(last_populations(folder))
    else:
        what, row = "best ever", next(iter(best_ever(folder)), None)
    if row is None:
        raise ViewerError(f"{folder}: --robot {name}: no robot has a fitness yet")
    birth = individual(row)
    line = f"{what}: {birth.name}, fitness {rounded(row['fitness'])}"
    if row["island"] != birth.island:
        line += f" on island {row['island']}; shown as on its island of birth"
    return birth, line


def show_motion(
    recording: Recording, motion: Motion, model: BoxModel, lane: int | None
) -> None:
    """Show the motion of a robot in a lane, or at its recorded place if it is None."""
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
