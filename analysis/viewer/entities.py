"""Names of a recording's entities, and the data that is logged to them."""

from dataclasses import dataclass

from schema.robot.ids import BirthId
from schema.wire.updates import Birth


@dataclass(frozen=True, slots=True)
class TimePoint:
    """Simulated time [s], None off-line, and births so far, if known."""

    sim_time_s: float | None = None
    births: int | None = None


@dataclass(slots=True)
class AncestryNode:
    """An individual in the ancestry graph: its birth, and its number among all."""

    birth: Birth
    order: int
    is_alive: bool = True


def recording_name(experiment: str, folder: str) -> str:
    """Return the name of a run's recording; that of the folder usually says both."""
    return folder if folder.startswith(experiment) else f"{experiment}-{folder}"


def island_path(island: int) -> str:
    """Return the entity of an island."""
    return f"islands/{island}"


def robot_path(island: int, birth: BirthId) -> str:
    """Return the entity of a robot that lives on an island."""
    return f"islands/{island}/robots/{birth.island}-{birth.number}"


def archive_path(island: int) -> str:
    """Return the entity of the archive map of an island."""
    return f"islands/{island}/archive"


def motion_path(birth: BirthId) -> str:
    """Return the entity of a re-simulated robot."""
    return f"motion/{birth.island}-{birth.number}"
