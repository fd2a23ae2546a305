"""Table rows of off-line islands, and those that arenas share with them."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

from coordinator.evolution.breeding import Candidate, Individual
from coordinator.evolution.encodings import IslandEncoding
from coordinator.evolution.founders import Founder
from coordinator.islands.events import Emigrate, Outcome, Record
from schema.parts import BodySpace
from schema.robot.ids import BirthId
from schema.robot.robot import Robot
from schema.tables.columns import Row
from schema.wire.protobuf import encode_robot


def named(birth: BirthId, island: int) -> dict[str, int | None]:
    """Return the columns that identify an individual in a row of an island."""
    return {
        "island": island,
        "birth_island": None if birth.island == island else birth.island,
        "birth": birth.number,
    }


def birth_record(
    candidate: Candidate,
    individual: Individual,
    encoding: IslandEncoding,
    *,
    sim_time_s: float | None = None,
    place: tuple[float, float] | None = None,
) -> Record:
    """Return the births row of a candidate that is born.

    On-line it has its simulated time [s] and its place in the ground plane [m].
    """
    stored = candidate.learnt
    if stored is None and encoding.stores_robots:
        stored = candidate.robot
    row = {
        "island": candidate.birth.island,
        "birth": candidate.birth.number,
        "parents": parent_column(candidate.couple or ()),
        "generation": individual.generation,
        "rank": individual.rank,
        "attempts": candidate.attempt + 1,
        "genome": candidate.genome,
        "body": body_rows(candidate.robot),
        **sizes(candidate.robot, encoding.types),
        "connections": candidate.connections,
        "sim_time_s": sim_time_s,
        "x": place and place[0],
        "y": place and place[1],
        "robot": stored and encode_robot(stored),
        **origin_columns(candidate.origin),
    }
    return Record("births", row)


def parent_column(parents: Iterable[Individual]) -> list[dict[str, int]]:
    """Return the column ``parents``: their birth ids."""
    return [{"island": one.birth.island, "birth": one.birth.number} for one in parents]


def origin_columns(founder: Founder | None) -> dict[str, Any]:
    """Return the columns of a births row that say where a given founder is from."""
    named, kept = founder or (None, None)
    return {
        "origin_digest": named and named.digest,
        "origin_island": named and named.island,
        "origin_birth": named and named.birth,
        "origin_run": (kept and kept.run) or None,
        "origin_file": (kept and kept.file) or None,
    }


def body_rows(robot: Robot) -> list[Row]:
    """Return the ``body`` of a births row: one dictionary per part, core first."""
    return [
        {
            "idx": index,
            "parent": part.parent,
            "parent_slot": part.parent_slot,
            "child_slot": part.slot,
            "kind": part.kind,
            "rot": part.orientation,
            "params": part.parameters,
            "gene": part.gene,
        }
        for index, part in enumerate(robot.parts)
    ]


def sizes(robot: Robot, space: BodySpace) -> dict[str, int]:
    """Return the counts of a births row.

    They are ``parts``, ``joints`` (driven or not), ``motors`` (driven), ``extremities``
    (parts without children; a lone core counts 1), ``inputs``, ``outputs`` and
    ``hidden``.

    Source: thesis section 6.3; the code of the original.
    """
    motors = passive = 0
    for part in robot.parts:
        kind = space[part.kind]
        if kind.motor is not None:
            motors += 1
        elif kind.shape(part.parameters).joint is not None:
            passive += 1
    layers = [neuron.layer for neuron in robot.brain.neurons]
    # Includes -1, the parent of the core.
    parents = {part.parent for part in robot.parts}
    return {
        "parts": len(robot.parts),
        "joints": motors + passive,
        "motors": motors,
        "extremities": len(robot.parts) + 1 - len(parents),
        "inputs": layers.count("input"),
        "outputs": layers.count("output"),
        "hidden": layers.count("hidden"),
    }


def outcome_columns(outcome: Outcome) -> dict[str, Any]:
    """Return reason and measures of an outcome; a failure has no measures."""
    found = outcome.evaluation
    return {
        "reason": outcome.reason,
        "fitness": found and found.fitness,
        "path_velocity": found and found.path_velocity,
        "straight_velocity": found and found.straight_velocity,
        "simulated_s": found and found.simulated_s,
    }


def named_measures(
    labels: Sequence[str], measures: Sequence[float]
) -> list[tuple[str, float]] | None:
    """Return the column ``measures``; None if there are none."""
    return list(zip(labels, measures, strict=True)) if measures else None


def evaluation_record(outcome: Outcome, labels: Sequence[str] = ()) -> Record:
    """Return the evaluations row of an outcome; the labels name its measures."""
    island = outcome.birth.island if outcome.requester is None else outcome.requester
    found = outcome.evaluation
    row = {
        **named(outcome.birth, island),
        "trial": outcome.trial,
        "status": "ok" if found else "failed",
        **outcome_columns(outcome),
        "wall_s": outcome.provenance.wall_s,
        "worker": outcome.provenance.agent,
        "platform": outcome.provenance.platform,
        "measures": found and named_measures(labels, found.measures),
        "point": outcome.point,
    }
    return Record("evaluations", row)


def population_records(
    island: int, births: int, fitness: Iterable[tuple[BirthId, float | None]]
) -> list[Record]:
    """Return the population rows of the living, each with its fitness if known."""
    now = {"island": island, "births": births}
    rows = (
        {**now, **named(birth, island), "fitness": value} for birth, value in fitness
    )
    return [Record("population", row) for row in rows]


class ArchiveRows:
    """Rows of the table ``archive``: what changed in the archive of an island."""

    def __init__(self, island: int) -> None:
        self._island = island
        self._last: dict[str, Row] = {}

    def changes(
        self,
        archive: Mapping[str, Individual],
        births: int,
        sim_time_s: float | None = None,
    ) -> list[Record]:
        """Return rows of entries that are empty now, then of new and changed ones."""
        rows: dict[str, Row] = {
            entry: {
                **named(one.birth, self._island),
                "fitness": one.known_fitness,
                "measures": list(one.measures.items()) or None,
            }
            for entry, one in archive.items()
        }
        empty = dict.fromkeys(("birth_island", "birth", "fitness", "measures"))
        changed = [(at, empty) for at in self._last if at not in rows]
        changed += [at for at in rows.items() if at[1] != self._last.get(at[0])]
        self._last = rows
        now = {"island": self._island, "births": births, "sim_time_s": sim_time_s}
        return [
            Record("archive", {**now, "entry": entry, **row}) for entry, row in changed
        ]


def migration_records(
    sent: Sequence[Emigrate], births: int, sim_time_s: float | None = None
) -> list[Record]:
    """Return the migrations rows of all migrants that were sent."""
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
                "fitness": one.known_fitness,
            },
        )
        for command in sent
        for one in command.migrants
    ]
