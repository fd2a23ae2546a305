"""Table rows of arenas, besides births and migrations."""

from collections.abc import Iterable, Sequence
from typing import NamedTuple

from coordinator.arena.living import LivingRobot
from coordinator.islands.events import Record
from coordinator.islands.rows import named, named_measures
from schema.wire.arena import Casualty, Touch


class Moment(NamedTuple):
    """State of an arena that its rows refer to.

    Attributes:
        island: number of the arena.
        births: number of births.
        sim_time_s: simulated time [s].
    """

    island: int
    births: int
    sim_time_s: float


def sample_records(
    living: Iterable[LivingRobot], moment: Moment, labels: Sequence[str] = ()
) -> list[Record]:
    """Return the fitness rows of a sample: all living robots with a report.

    Args:
        living: the robots.
        moment: of the sample.
        labels: names of their measures.
    """
    return [
        Record(
            "fitness",
            {
                **named(one.birth, moment.island),
                "sim_time_s": moment.sim_time_s,
                "births": moment.births,
                "age_s": one.judgement.age_s,
                "path_velocity": one.judgement.path_velocity,
                "straight_velocity": one.judgement.straight_velocity,
                "fitness": one.judgement.fitness,
                "is_mature": one.is_mature,
                "measures": named_measures(labels, one.judgement.measures),
            },
        )
        for one in living
        if one.judgement is not None
    ]


def death_record(dead: LivingRobot | Casualty, reason: str, moment: Moment) -> Record:
    """Return the deaths row of a robot that is removed or has diverged."""
    x, y, z = dead.place if isinstance(dead, Casualty) else dead.position
    row = {
        **named(dead.birth, moment.island),
        "sim_time_s": moment.sim_time_s,
        "births": moment.births,
        "reason": reason,
        "detail": dead.reason if isinstance(dead, Casualty) else "",
        "x": x,
        "y": y,
        "z": z,
    }
    return Record("deaths", row)


def touch_records(
    touches: Iterable[Touch], moment: Moment, over_s: float
) -> list[Record]:
    """Return the touches rows of an advance that lasted ``over_s``."""
    return [
        Record(
            "touches",
            {
                **named(touch.first, moment.island),
                "other_island": touch.second.island,
                "other_birth": touch.second.number,
                "sim_time_s": moment.sim_time_s,
                "over_s": over_s,
                "duration_s": touch.duration_s,
            },
        )
        for touch in touches
    ]
