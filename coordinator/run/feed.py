"""Updates for viewers of a run: its new rows, condensed and numbered.

No run waits for a viewer. The feed keeps a short form of everything that it sent,
so that a viewer that connects late or lost an update gets the whole.
"""

from msgspec.structs import replace

from coordinator.islands.events import Record
from coordinator.storage.folder import RunDetails
from schema.robot.ids import BirthId
from schema.tables.columns import Row
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
        self._born: dict[int, int] = {}
        self._deaths: list[Death] = []
        self._levels: list[Level] = []
        self._newest: dict[int, Level] = {}
        self._migrants: list[Migrant] = []
        self._new_births: list[Birth] = []
        self._new_deaths: list[Death] = []
        self._new_rows: list[Row] = []
        self._new_migrants: list[Migrant] = []
        self._workers: tuple[WorkerInfo, ...] = ()

    def read(self) -> None:
        """Note the rows that are unread."""
        for record in self.unread:
            self._note(record)
        self.unread.clear()

    def _note(self, record: Record) -> None:
        row = record.row
        match record.table:
            case "births":
                island = row["island"]
                self._born[island] = self._born.get(island, 0) + 1
                self._new_births.append(read_birth(row, self._born[island]))
            case "population":
                self._new_rows.append(dict(row))
            case "deaths":
                self._new_deaths.append(read_death(row))
            case "migrations":
                self._new_migrants.append(read_migrant(row))

    def update(self, workers: tuple[WorkerInfo, ...]) -> Update | None:
        """Return what is new since the last call; None if nothing is new."""
        self.read()
        fresh = read_levels(self._new_rows)
        is_new = self._new_births or self._new_deaths or fresh or self._new_migrants
        if not is_new and workers == self._workers:
            return None
        self._past = replace(self._past, sequence=self._past.sequence + 1)
        update = replace(
            self._past,
            is_whole=False,
            document="",
            births=tuple(self._new_births),
            deaths=tuple(self._new_deaths),
            levels=tuple(fresh),
            migrants=tuple(self._new_migrants),
            workers=workers,
        )
        self._remember(update)
        for sent in (
            self._new_births, self._new_deaths, self._new_rows, self._new_migrants
        ):  # fmt: skip
            sent.clear()
        return update

    def whole(self) -> Update:
        """Return everything that ``update`` has returned so far, as one update."""
        all_levels = {(level.island, level.births): level for level in self._levels}
        for newest in self._newest.values():
            all_levels[newest.island, newest.births] = newest
        return replace(
            self._past,
            births=tuple(self._births.values()),
            deaths=tuple(self._deaths),
            levels=tuple(all_levels.values()),
            migrants=tuple(self._migrants),
            workers=self._workers,
        )

    def _remember(self, update: Update) -> None:
        """Add an update to the past; drop the bodies of dead robots."""
        self._workers = update.workers
        self._migrants += update.migrants
        self._deaths += update.deaths
        self._dead.update(gone.birth for gone in update.deaths)
        for level in update.levels:
            self._levels.append(replace(level, members=()))
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
