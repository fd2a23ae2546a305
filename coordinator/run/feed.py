"""Updates for viewers of a run: its new rows, condensed and numbered.

No run waits for a viewer. The feed keeps a short form of everything that it sent,
so that a viewer that connects late or lost an update gets the whole.
"""

from collections import Counter, defaultdict
from typing import Any

from msgspec.structs import replace

from coordinator.islands.events import Record
from coordinator.storage.folder import RunDetails
from schema.robot.ids import BirthId
from schema.wire.updates import (
    Birth,
    Death,
    Level,
    Migrant,
    Update,
    WorkerInfo,
    read_birth,
    read_death,
    read_levels,
    read_migrant,
)


class Feed:
    """Updates of one run; a replay of its journal fills it, too.

    Attributes:
        unread: rows that the next call of ``read`` or ``update`` takes.
    """

    def __init__(self, run: str, epoch: int, details: RunDetails) -> None:
        """Initialise without rows.

        Args:
            run: name of the run.
            epoch: of the coordinator.
            details: of the run.
        """
        self.unread: list[Record] = []
        self._past = Update(
            run, epoch, 0, is_whole=True, experiment=details.name,
            document=details.document,
        )  # fmt: skip
        self._births: dict[BirthId, Birth] = {}
        self._bodies: list[BirthId] = []
        self._dead: set[BirthId] = set()
        self._born = Counter[int]()
        self._deaths: list[Death] = []
        self._levels: dict[tuple[int, int], Level] = {}
        self._newest: dict[int, Level] = {}
        self._migrants: list[Migrant] = []
        # By table: births, deaths, migrants, and rows of populations.
        self._new: defaultdict[str, list[Any]] = defaultdict(list)

    def read(self) -> None:
        """Note the rows that are unread."""
        for record in self.unread:
            row, new = record.row, self._new[record.table]
            match record.table:
                case "births":
                    self._born[row["island"]] += 1
                    new.append(read_birth(row, self._born[row["island"]]))
                case "population":
                    new.append(row)
                case "deaths":
                    new.append(read_death(row))
                case "migrations":
                    new.append(read_migrant(row))
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
            levels=tuple(read_levels(new["population"])),
            migrants=tuple(new["migrations"]),
        )
        self._remember(update)
        return update

    def whole(self) -> Update:
        """Return everything that ``update`` has returned so far, as one update."""
        return replace(
            self._past,
            births=tuple(self._births.values()),
            deaths=tuple(self._deaths),
            levels=tuple(self._levels.values()),
            migrants=tuple(self._migrants),
        )

    def _remember(self, update: Update) -> None:
        """Add an update to the past; drop the bodies of dead robots."""
        self._migrants += update.migrants
        self._deaths += update.deaths
        self._dead.update(gone.birth for gone in update.deaths)
        for level in update.levels:
            if before := self._newest.get(level.island):
                short = replace(before, members=())
                self._levels[before.island, before.births] = short
            self._levels[level.island, level.births] = level
            self._newest[level.island] = level
        self._births.update((one.birth, one) for one in update.births)
        self._bodies += [one.birth for one in update.births]
        members = {birth for level in self._newest.values() for birth in level.members}
        kept: list[BirthId] = []
        for birth in self._bodies:
            one = self._births[birth]
            newest = self._newest.get(birth.island)
            is_new = newest is None or one.births > newest.births
            if birth not in self._dead and (is_new or birth in members):
                kept.append(birth)
            else:
                self._births[birth] = replace(one, body=None)
        self._bodies = kept
