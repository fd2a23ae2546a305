"""Names of a recording's entities, and the data that is logged to them."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from analysis.viewer.body import Float32s
from schema.robot.ids import BirthId


@dataclass(frozen=True, slots=True)
class TimePoint:
    """Simulated time [s], None off-line, and births so far, if known."""

    sim_time_s: float | None = None
    births: int | None = None


@dataclass(frozen=True, slots=True)
class PoseBatch:
    """T poses of one robot, their times (T,) [s] and births so far (T,), if known."""

    sim_time_s: npt.NDArray[np.float64]
    births: npt.NDArray[np.int64] | None
    centres: Float32s
    attitudes: Float32s


@dataclass(frozen=True, slots=True)
class AncestryNode:
    """An individual in the ancestry graph: column, row (its rank) and parents."""

    birth: BirthId
    order: int
    rank: int
    parents: tuple[BirthId, ...]
    is_alive: bool


def name_of(birth: BirthId) -> str:
    """Return the name of an individual as ISLAND:BIRTH."""
    return f"{birth.island}:{birth.number}"


def island_path(island: int) -> str:
    """Return the entity of an island."""
    return f"islands/{island}"


def robot_path(island: int, birth: BirthId) -> str:
    """Return the entity of a robot that lives on an island."""
    return f"islands/{island}/robots/{birth.island}-{birth.number}"


def motion_path(birth: BirthId) -> str:
    """Return the entity of a re-simulated robot."""
    return f"motion/{birth.island}-{birth.number}"
