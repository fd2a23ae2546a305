"""What the coordinator tells those who watch a run: its tables' rows, condensed.

Live it comes as ``News`` over the network, in a replay from the tables; both pass
through the functions of this file, so that a viewer shows the same of either.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from itertools import groupby
from math import fsum
from typing import Any

from schema.robot.ids import BirthId
from schema.robot.robot import Part, Robot


@dataclass(frozen=True, slots=True)
class Newborn:
    """A birth.

    Attributes:
        birth: who.
        parents: in order; none for a random robot.
        rank: one more than the greatest of the parents'.
        births: on its island so far, this one included.
        sim_time_s: when, in an arena [s]; None off-line.
        body: without a brain; None of those who do not live any more.
    """

    birth: BirthId
    parents: tuple[BirthId, ...]
    rank: int
    births: int
    sim_time_s: float | None
    body: Robot | None


@dataclass(frozen=True, slots=True)
class Departed:
    """A robot left an arena for good.

    Attributes:
        island: whose arena.
        birth: who.
        births: on the island so far.
        sim_time_s: when [s].
        reason: as in the deaths table.
    """

    island: int
    birth: BirthId
    births: int
    sim_time_s: float
    reason: str


@dataclass(frozen=True, slots=True)
class Level:
    """How fit a population was when so many had been born on its island.

    Attributes:
        island: whose population.
        births: there, so far.
        size: how many lived.
        judged: how many of them had a fitness.
        mean, best: of those; 0 of none.
        members: who lived, ascending; told of an island's newest level only.
    """

    island: int
    births: int
    size: int
    judged: int
    mean: float
    best: float
    members: tuple[BirthId, ...] = ()


@dataclass(frozen=True, slots=True)
class Migrant:
    """An individual went, or was copied, from one island to another.

    Attributes:
        birth: who.
        island, to: from where, and where to.
        epoch: of the exchange.
        births: on the island that it left, so far.
        sim_time_s: when, in an arena [s]; None off-line.
    """

    birth: BirthId
    island: int
    to: int
    epoch: int
    births: int
    sim_time_s: float | None


@dataclass(frozen=True, slots=True)
class Crewman:
    """A worker that is there, its platform, and the arena shards that it holds."""

    name: str
    platform: str
    shards: tuple[int, ...]


@dataclass(frozen=True, slots=True)
class News:
    """What happened in a run since the news before, or all of it.

    Attributes:
        run: its name.
        epoch: of its coordinator.
        sequence: number of these news; one that is missing was lost.
        is_whole: all since the beginning; what was told before is to be forgotten.
        experiment: its name.
        births, deaths, levels, migrants: in the order of their tables.
        workers: all that are there now.
        document: the experiment's JSON, if is_whole.
    """

    run: str
    epoch: int
    sequence: int
    is_whole: bool
    experiment: str
    births: tuple[Newborn, ...] = ()
    deaths: tuple[Departed, ...] = ()
    levels: tuple[Level, ...] = ()
    migrants: tuple[Migrant, ...] = ()
    workers: tuple[Crewman, ...] = ()
    document: str = ""


def newborn(row: Mapping[str, Any], births: int) -> Newborn:
    """Return what a row of the births table tells.

    Args:
        row: of the table; ``genome`` and the counts are not looked at.
        births: on its island so far, this one included.
    """
    return Newborn(
        BirthId(row["island"], row["birth"]),
        tuple(BirthId(each["island"], each["birth"]) for each in row["parents"]),
        row["rank"],
        births,
        row["sim_time_s"],
        Robot(tuple(map(_part, row["body"]))),
    )


def individual(row: Mapping[str, Any]) -> BirthId:
    """Return whom a row is about: one born where it is, unless it says otherwise."""
    island = row.get("birth_island")
    return BirthId(row["island"] if island is None else island, row["birth"])


def departed(row: Mapping[str, Any]) -> Departed:
    """Return what a row of the deaths table tells."""
    return Departed(
        row["island"],
        individual(row),
        row["births"],
        row["sim_time_s"],
        row["reason"],
    )


def levels(rows: Iterable[Mapping[str, Any]]) -> list[Level]:
    """Return what rows of the population table tell, each set of them as one level.

    Args:
        rows: in the order of the table, so that those of one set stand together.
    """
    sets = groupby(rows, key=lambda row: (row["island"], row["births"]))
    return [_level(island, births, list(each)) for (island, births), each in sets]


def _level(island: int, births: int, rows: Sequence[Mapping[str, Any]]) -> Level:
    fitness = [row["fitness"] for row in rows if row["fitness"] is not None]
    return Level(
        island=island,
        births=births,
        size=len(rows),
        judged=len(fitness),
        mean=fsum(fitness) / len(fitness) if fitness else 0.0,
        best=max(fitness, default=0.0),
        members=tuple(sorted(map(individual, rows))),
    )


def migrant(row: Mapping[str, Any]) -> Migrant:
    """Return what a row of the migrations table tells."""
    return Migrant(
        individual(row),
        row["island"],
        row["to"],
        row["epoch"],
        row["births"],
        row["sim_time_s"],
    )


def _part(row: Mapping[str, Any]) -> Part:
    return Part(
        row["kind"],
        row["parent"],
        row["parent_slot"],
        row["child_slot"],
        row["rot"],
        tuple(row["params"]),
        row["gene"],
    )
