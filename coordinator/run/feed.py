"""Updates for viewers of a run: its new rows, condensed and numbered.

No run waits for a viewer. The feed keeps a short form of everything that it sent,
so that a viewer that connects late or lost an update gets the whole.
"""

from collections import Counter, defaultdict
from typing import Any

from msgspec import Raw
from msgspec.msgpack import encode
from msgspec.structs import replace

from coordinator.islands.events import Record
from schema.robot.ids import BirthId
from schema.tables.description import RunDetails
from schema.wire.elites import EliteReader
from schema.wire.updates import (
    SAMPLED,
    Birth,
    Level,
    Migrant,
    Update,
    WorkerInfo,
    arenas_of,
    read_birth,
    read_death,
    read_levels,
    read_migrant,
    read_samples,
)

_MOST_SAMPLED = 20_000
"""Rows of arenas with own rules in an update; the last ones after a replay."""


class Feed:
    """Updates of one run; a replay of its journal fills it, too.

    Attributes:
        unread: rows that the next call of ``read`` or ``update`` takes.
    """

    def __init__(self, run: str, epoch: int, details: RunDetails) -> None:
        """Initialise without rows; ``epoch`` is that of the coordinator."""
        self.unread: list[Record] = []
        self._past = Update(
            run, epoch, 0, is_whole=True, experiment=details.name,
            document=details.document,
        )  # fmt: skip
        # Bytes take less than half the memory of objects. Births are without bodies.
        self._births: list[bytes] = []
        self._deaths: list[bytes] = []
        self._levels: list[bytes] = []
        self._bodies: dict[BirthId, tuple[int, Birth]] = {}
        self._born = Counter[int]()
        self._arenas = set[int]()
        self._newest: dict[int, Level] = {}
        self._migrants: list[Migrant] = []
        self._elites = EliteReader(details.document)
        # By table: births, deaths, migrants, and rows of populations.
        self._new: defaultdict[str, list[Any]] = defaultdict(list)

    def read(self) -> None:
        """Note the rows that are unread."""
        for record in self.unread:
            row, new = record.row, self._new[record.table]
            if elite := self._elites.read(record.table, row):
                self._new["elites"].append(elite)
            match record.table:
                case "births":
                    self._born[row["island"]] += 1
                    birth = read_birth(row, self._born[row["island"]])
                    self._arenas |= arenas_of([birth])
                    new.append(birth)
                case "population":
                    new.append(row)
                case "deaths":
                    new.append(read_death(row))
                case "migrations":
                    new.append(read_migrant(row))
                case table if table in SAMPLED and row.get("stores", True):
                    self._new["samples"].append((table, row))
        del self._new["samples"][:-_MOST_SAMPLED]
        self.unread.clear()

    def update(self, workers: tuple[WorkerInfo, ...]) -> Update | None:
        """Return what is new since the last call; None if nothing is new."""
        self.read()
        if not any(self._new.values()) and workers == self._past.workers:
            return None
        new, self._new = self._new, defaultdict(list)
        sequence = self._past.sequence + 1
        self._past = replace(self._past, sequence=sequence, workers=workers)
        update = replace(
            self._past,
            is_whole=False,
            document="",
            births=tuple(new["births"]),
            deaths=tuple(new["deaths"]),
            levels=tuple(read_levels(new["population"], self._arenas)),
            migrants=tuple(new["migrations"]),
            samples=tuple(read_samples(new["samples"])),
            elites=tuple(new["elites"]),
        )
        self._remember(update)
        return update

    def whole(self) -> Update:
        """Return everything that ``update`` has returned so far, as one update.

        It can only be encoded: most of its rows are encoded already.
        """
        births: list[Any] = list(map(Raw, self._births))
        for index, birth in self._bodies.values():
            births[index] = birth
        rows: dict[str, Any] = {
            "births": births,
            "deaths": list(map(Raw, self._deaths)),
            "levels": [*map(Raw, self._levels), *self._newest.values()],
            "elites": list(self._elites.best.values()),
        }
        return replace(self._past, migrants=tuple(self._migrants), **rows)

    def _remember(self, update: Update) -> None:
        """Add an update to the past; drop the bodies of dead robots."""
        for birth in update.births:
            self._bodies[birth.birth] = len(self._births), birth
            self._births.append(encode(replace(birth, body=None)))
        for death in update.deaths:
            self._bodies.pop(death.birth, None)
            self._deaths.append(encode(death))
        for level in update.levels:
            before = self._newest.get(level.island, level)
            if before.births != level.births:
                self._levels.append(encode(replace(before, members=())))
            self._newest[level.island] = level
        self._migrants += update.migrants
        members = {birth for level in self._newest.values() for birth in level.members}
        self._bodies = {
            name: (index, birth)
            for name, (index, birth) in self._bodies.items()
            if name in members or self._is_new(birth)
        }

    def _is_new(self, birth: Birth) -> bool:
        """Return whether no population of its island is as new as a birth."""
        newest = self._newest.get(birth.birth.island)
        return newest is None or birth.births > newest.births
