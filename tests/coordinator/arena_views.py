"""What rules of arenas see, made by hand."""

from collections.abc import Sequence

import numpy as np

from schema.plugins.arena_rules import ArenaView, Meeting, Resident, Stores
from schema.robot.ids import BirthId


def born(*numbers: int) -> tuple[BirthId, ...]:
    """Return births of island 0."""
    return tuple(BirthId(0, number) for number in numbers)


def resident(
    number: int,
    stores: Stores,
    *,
    place: tuple[float, float] = (0.0, 0.0),
    track: Sequence[tuple[float, float]] | None = None,
    age_s: float = 100.0,
    work_j: float = 0.0,
    fitness: float | None = None,
) -> Resident:
    """Return a robot that stands, unless it has a track."""
    points = np.array([place] * 5 if track is None else track, np.float32)
    return Resident(
        BirthId(0, number),
        (),
        age_s,
        place,
        points.reshape(-1, 2),
        work_j,
        fitness,
        {},
        5,
        is_infant=False,
        stores=stores,
    )


def view(
    *robots: Resident,
    time_s: float = 100.0,
    meetings: tuple[Meeting, ...] = (),
    children: tuple[BirthId | None, ...] = (),
    interval_s: float = 1.0,
    room: int = 20,
    is_due: bool = True,
) -> ArenaView:
    """Return a view of robots, a second after the last decision."""
    return ArenaView(
        time_s, interval_s, 30, room, is_due, is_due, robots, meetings, children
    )
