"""What an arena writes beside births: rows of the tables in `schema.tables.columns`."""

from collections.abc import Iterable

from coordinator.arena.living import LivingRobot
from coordinator.islands.events import Record
from coordinator.islands.rows import named
from schema.wire.arena import Casualty, Touch


def sample_records(
    living_robots: Iterable[LivingRobot], island: int, births: int, sim_time_s: float
) -> list[Record]:
    """Return the fitness rows of a sample: all living who were ever judged."""
    return [
        Record(
            "fitness",
            {
                **named(one.birth, island),
                "sim_time_s": sim_time_s,
                "births": births,
                "age_s": one.judgement.age_s,
                "path_velocity": one.judgement.path_velocity,
                "straight_velocity": one.judgement.straight_velocity,
                "fitness": one.judgement.fitness,
                "is_mature": one.judgement.is_mature,
            },
        )
        for one in living_robots
        if one.judgement is not None
    ]


def living_records(
    living_robots: Iterable[LivingRobot], island: int, births: int
) -> list[Record]:
    """Return the population rows at a birth; the immature have no fitness yet."""
    return [
        Record(
            "population",
            {
                "island": island,
                "births": births,
                **named(one.birth, island),
                "fitness": one.individual.fitness if one.is_mature else None,
            },
        )
        for one in living_robots
    ]


def casualty_record(
    casualty: Casualty, island: int, births: int, sim_time_s: float
) -> Record:
    """Return the deaths row of a robot whose physics diverged."""
    x, y, z = casualty.place
    row = {
        **named(casualty.birth, island),
        "sim_time_s": sim_time_s,
        "births": births,
        "reason": "diverged",
        "detail": casualty.reason,
        "x": x,
        "y": y,
        "z": z,
    }
    return Record("deaths", row)


def death_record(
    resident: LivingRobot, reason: str, *, island: int, births: int, sim_time_s: float
) -> Record:
    """Return the deaths row of a robot that is taken out where it stands."""
    x, y = resident.last_place
    row = {
        **named(resident.birth, island),
        "sim_time_s": sim_time_s,
        "births": births,
        "reason": reason,
        "detail": "",
        "x": x,
        "y": y,
        "z": resident.judgement and resident.judgement.place[2],
    }
    return Record("deaths", row)


def touch_records(
    touches: Iterable[Touch], island: int, sim_time_s: float, over_s: float
) -> list[Record]:
    """Return the touches rows of an advance that took ``over_s``."""
    return [
        Record(
            "touches",
            {
                **named(touch.first, island),
                "other_island": touch.second.island,
                "other_birth": touch.second.number,
                "sim_time_s": sim_time_s,
                "over_s": over_s,
                "duration_s": touch.duration_s,
            },
        )
        for touch in touches
    ]
