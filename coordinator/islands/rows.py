"""What islands write: rows of the tables in `schema.tables.columns`."""

from collections.abc import Sequence

from coordinator.evolution.selection import Individual
from coordinator.islands.events import Emigrate, Evaluated, EvaluationFailed, Record
from schema.parts import BodySpace
from schema.robot.ids import BirthId
from schema.robot.robot import Robot
from schema.tables.columns import body_rows, sizes
from schema.wire.codec import encode_genome


def named(birth: BirthId, island: int) -> dict[str, int | None]:
    """Return the columns that name an individual in a row of some island."""
    return {
        "island": island,
        "birth_island": None if birth.island == island else birth.island,
        "birth": birth.number,
    }


def birth_record(
    individual: Individual,
    parents: Sequence[Individual],
    attempts: int,
    robot: Robot,
    space: BodySpace,
    *,
    sim_time_s: float | None = None,
    place: tuple[float, float] | None = None,
) -> Record:
    """Return the births row of an individual.

    Args:
        individual: who was born.
        parents: in order; none for a random robot.
        attempts: that it took, this one included.
        robot: what its genome develops into.
        space: the part types.
        sim_time_s: when it was born on-line [s].
        place: and where, in the ground plane [m].
    """
    row = {
        "island": individual.birth.island,
        "birth": individual.birth.number,
        "parents": [
            {"island": parent.birth.island, "birth": parent.birth.number}
            for parent in parents
        ],
        "generation": individual.generation,
        "rank": individual.rank,
        "attempts": attempts,
        "genome": encode_genome(individual.genome),
        "body": body_rows(robot),
        **sizes(robot, individual.genome, space),
        "sim_time_s": sim_time_s,
        "x": place and place[0],
        "y": place and place[1],
    }
    return Record("births", row)


def evaluation_record(outcome: Evaluated | EvaluationFailed) -> Record:
    """Return the evaluations row of an outcome; a failure has no numbers."""
    provenance = outcome.provenance
    judged = outcome.evaluation if isinstance(outcome, Evaluated) else None
    island = outcome.birth.island if outcome.requester is None else outcome.requester
    row = {
        **named(outcome.birth, island),
        "trial": outcome.trial,
        "status": "ok" if isinstance(outcome, Evaluated) else "failed",
        "reason": "" if isinstance(outcome, Evaluated) else outcome.reason,
        "fitness": judged and judged.fitness,
        "path_velocity": judged and judged.path_velocity,
        "straight_velocity": judged and judged.straight_velocity,
        "simulated_s": judged and judged.simulated_s,
        "wall_s": provenance.wall_s,
        "worker": provenance.agent,
        "platform": provenance.platform,
    }
    return Record("evaluations", row)


def population_records(
    island: int, births: int, population: Sequence[Individual]
) -> list[Record]:
    """Return the population rows: who is alive when so many had been born."""
    return [
        Record(
            "population",
            {
                "island": island,
                "births": births,
                **named(individual.birth, island),
                "fitness": None if individual.has_failed else individual.fitness,
            },
        )
        for individual in population
    ]


def migration_records(
    sent: Sequence[Emigrate], births: int, sim_time_s: float | None = None
) -> list[Record]:
    """Return the migrations rows of all who were sent."""
    return [
        Record(
            "migrations",
            {
                "island": command.island,
                "to": command.to,
                "epoch": command.epoch,
                "births": births,
                "sim_time_s": sim_time_s,
                "birth_island": one.birth.island,
                "birth": one.birth.number,
                "fitness": None if one.has_failed else one.fitness,
            },
        )
        for command in sent
        for one in command.migrants
    ]
