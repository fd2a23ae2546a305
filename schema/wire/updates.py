"""What a coordinator sends to viewers: rows of a run's tables, condensed.

A live run sends an ``Update`` a few times per second. A replay builds the same from
the tables, through the functions of this file, so that a viewer shows both alike.
"""

from collections import defaultdict
from collections.abc import Container, Iterable, Mapping, Sequence
from itertools import groupby
from math import fsum
from operator import itemgetter
from typing import Annotated, Any

from msgspec import Meta

from schema.experiment.section import Count
from schema.limits import MOST_PARTS, PAGE_BYTES, UPDATE_BYTES, Finite
from schema.robot.ids import BirthId, IslandNumber
from schema.robot.results import failed_fitness
from schema.robot.robot import Part
from schema.wire.codec import Message, decode, encode
from schema.wire.elites import Elite


class Birth(Message, frozen=True):
    """A birth.

    Attributes:
        birth: id of the individual.
        parents: ids, in order; empty for a random robot.
        rank: one more than the greatest rank of the parents.
        births: number of births on the island so far, this one included.
        sim_time_s: simulated time of the birth in an arena [s]; None off-line.
        body: parts of the robot; None if it is dead.
    """

    birth: BirthId
    parents: tuple[BirthId, ...]
    rank: Count
    births: Count
    sim_time_s: Finite | None
    body: Annotated[tuple[Part, ...], Meta(max_length=MOST_PARTS)] | None


class RecordedDeath(Message, frozen=True):
    """A death in an arena.

    Attributes:
        island: number of the arena's island.
        birth: id of the individual.
        births: number of births on the island so far.
        sim_time_s: simulated time of the death [s].
        reason: as in the deaths table.
    """

    island: IslandNumber
    birth: BirthId
    births: Count
    sim_time_s: Finite
    reason: str


class Level(Message, frozen=True):
    """Fitness of a population after a number of births.

    Attributes:
        island: number of the population's island.
        births: number of births on the island so far.
        size: number of living individuals.
        judged: number of living individuals whose fitness counts: in an arena that of
            mature robots, off-line that of all; failures count as ``failed_fitness``.
        mean, best: fitness of those; 0 if there is none.
        members: living individuals, ascending; given for the newest level of an
            island only.
    """

    island: IslandNumber
    births: Count
    size: Count
    judged: Count
    mean: Finite
    best: Finite
    members: tuple[BirthId, ...] = ()


class Migrant(Message, frozen=True):
    """A migration of an individual, moved or copied.

    Attributes:
        birth: id of the individual.
        island, to: numbers of the islands that it left and reached.
        epoch: number of the migration epoch.
        births: number of births on the island that it left, so far.
        sim_time_s: simulated time when it left an arena [s]; None off-line.
    """

    birth: BirthId
    island: IslandNumber
    to: IslandNumber
    epoch: Count
    births: Count
    sim_time_s: Finite | None


class ArenaSample(Message, frozen=True):
    """What the rules of an arena keep, and which robots met, at a time.

    Attributes:
        island, sim_time_s: number of the arena's island, and the time [s].
        store, stores: first store of its robots, and its values.
        over_s: time since the decision before, in which the pairs met [s].
        pairs: robots that met, and whether they have just had a child.
        patches: centre x, y [m], radius [m] and content of each.
    """

    island: IslandNumber
    sim_time_s: Finite
    store: str = ""
    stores: tuple[tuple[BirthId, Finite], ...] = ()
    over_s: Finite = 0.0
    pairs: tuple[tuple[BirthId, BirthId, bool], ...] = ()
    patches: tuple[tuple[Finite, Finite, Finite, Finite], ...] = ()


class WorkerInfo(Message, frozen=True):
    """A connected worker.

    Attributes:
        name: of its process.
        platform: processor class, system and libraries, which decide rounding.
        shards: numbers of the arenas that it holds.
    """

    name: str
    platform: str
    shards: tuple[IslandNumber, ...]


class Update(Message, frozen=True):
    """What happened in a run since the update before, or since its beginning.

    Attributes:
        run: name of the run.
        epoch: of its coordinator.
        sequence: number of the update; a viewer detects lost updates by a gap.
        is_whole: holds everything since the beginning and replaces earlier updates.
        experiment: name of the experiment.
        births, deaths, levels, migrants: in the order of their tables.
        workers: all that are connected now.
        document: JSON of the experiment, if is_whole.
        samples: of arenas with own rules; a whole of a live run has none.
        elites: new ones of cells; those of a whole are the fittest of each.
    """

    run: str
    epoch: Count
    sequence: Count
    is_whole: bool
    experiment: str
    births: tuple[Birth, ...] = ()
    deaths: tuple[RecordedDeath, ...] = ()
    levels: tuple[Level, ...] = ()
    migrants: tuple[Migrant, ...] = ()
    workers: tuple[WorkerInfo, ...] = ()
    document: str = ""
    samples: tuple[ArenaSample, ...] = ()
    elites: tuple[Elite, ...] = ()


class Page(Message, frozen=True):
    """A page of a run's state, which is an ``Update`` of everything.

    Without data it is a viewer's request for this page and some that follow.

    Attributes:
        data: part of the bytes of the ``Update``.
        run: name of the run.
        sequence: of the state; if it is outdated, page 0 of a newer one is sent.
        page, pages: number of this page, from 0, and of all pages.
    """

    data: Annotated[bytes, Meta(max_length=PAGE_BYTES)]
    run: str = ""
    sequence: Count = 0
    page: Count = 0
    pages: Annotated[int, Meta(ge=0, le=UPDATE_BYTES // PAGE_BYTES)] = 0


SAMPLED = ("fitness", "meetings", "matings", "patches")
"""Tables of an arena with rules of its own that viewers show."""
_MIGRANT = itemgetter("island", "to", "epoch", "births", "sim_time_s")
_PATCH = itemgetter("x", "y", "radius_m", "content")
_PART = itemgetter(
    "kind", "parent", "parent_slot", "child_slot", "rot", "params", "gene"
)


def decode_page(data: bytes) -> Page:
    """Return the page or the request of some bytes; without bytes, that for page 0.

    Raises:
        MalformedMessage: not the bytes of a page.
    """
    return decode(Page, data, 2 * PAGE_BYTES) if data else Page(b"")


def pages_of(state: Update) -> list[bytes]:
    """Return the pages of a state, encoded."""
    data = encode(state)
    parts = [data[at : at + PAGE_BYTES] for at in range(0, len(data), PAGE_BYTES)]
    return [
        encode(Page(part, state.run, state.sequence, number, len(parts)))
        for number, part in enumerate(parts)
    ]


def read_birth(row: Mapping[str, Any], births: int) -> Birth:
    """Return the birth of a row of the births table.

    Args:
        row: of the table; ``genome`` and the counts are not read.
        births: number of births on its island so far, this one included.
    """
    return Birth(
        BirthId(row["island"], row["birth"]),
        tuple(BirthId(each["island"], each["birth"]) for each in row["parents"]),
        row["rank"],
        births,
        row["sim_time_s"],
        tuple(map(_part, row["body"])),
    )


def individual(row: Mapping[str, Any]) -> BirthId:
    """Return the individual of a row: by default one born on the row's island."""
    island = row.get("birth_island")
    return BirthId(row["island"] if island is None else island, row["birth"])


def read_death(row: Mapping[str, Any]) -> RecordedDeath:
    """Return the death of a row of the deaths table."""
    time_s, reason = row["sim_time_s"], row["reason"]
    return RecordedDeath(row["island"], individual(row), row["births"], time_s, reason)


def arenas_of(births: Iterable[Birth]) -> set[int]:
    """Return the numbers of the islands that are arenas: births there have a time."""
    return {one.birth.island for one in births if one.sim_time_s is not None}


def read_levels(
    rows: Iterable[Mapping[str, Any]], arenas: Container[int]
) -> list[Level]:
    """Return the levels of rows of the population table, one per set of rows.

    Args:
        rows: in the order of the table, so that rows of one set are adjacent. A null
            fitness is in an arena that of an immature robot, otherwise of a failure.
        arenas: numbers of the islands that are arenas.
    """
    sets = groupby(rows, key=lambda row: (row["island"], row["births"]))
    return [
        _level(island, births, list(each), is_online=island in arenas)
        for (island, births), each in sets
    ]


def _level(
    island: int, births: int, rows: Sequence[Mapping[str, Any]], *, is_online: bool
) -> Level:
    known = [row["fitness"] for row in rows if row["fitness"] is not None]
    failed = 0 if is_online else len(rows) - len(known)
    fitness = known + [failed_fitness(known)] * failed
    return Level(
        island=island,
        births=births,
        size=len(rows),
        judged=len(fitness),
        # Their sum may be no finite number.
        mean=fsum(each / len(fitness) for each in fitness),
        best=max(fitness, default=0.0),
        members=tuple(sorted(map(individual, rows))),
    )


def read_migrant(row: Mapping[str, Any]) -> Migrant:
    """Return the migration of a row of the migrations table."""
    return Migrant(individual(row), *_MIGRANT(row))


def read_samples(rows: Iterable[tuple[str, Mapping[str, Any]]]) -> list[ArenaSample]:
    """Return the samples of rows of the tables ``SAMPLED``, with their names."""
    samples = defaultdict[tuple[float, int], Any](lambda: defaultdict(list))
    for table, row in rows:
        sample = samples[row["sim_time_s"], row["island"]]
        if table == "patches":
            sample["patches"].append(_PATCH(row))
        elif table == "meetings":
            other = BirthId(row["other_island"], row["other_birth"])
            sample["pairs"].append((individual(row), other, False))
            sample["over_s"] = row["over_s"]
        elif table == "fitness":
            for sample["store"], value in (row["stores"] or ())[:1]:
                sample["stores"].append((individual(row), value))
        elif row["birth"] is not None and len(row["parents"]) > 1:
            parents = (BirthId(one["island"], one["birth"]) for one in row["parents"])
            sample["pairs"].append((*parents, True))
    return [ArenaSample(at[1], at[0], **samples[at]) for at in sorted(samples)]


def _part(row: Mapping[str, Any]) -> Part:
    kind, parent, parent_slot, slot, orientation, parameters, gene = _PART(row)
    return Part(kind, parent, parent_slot, slot, orientation, tuple(parameters), gene)
