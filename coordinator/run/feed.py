"""What a run tells those who watch: news of its rows, numbered, best effort.

Nothing waits for a viewer, and nobody who watches changes a row. What is told is
remembered in short, so that one who comes late, or missed something, is told all.
"""

from dataclasses import replace

from coordinator.islands.events import Record
from coordinator.storage.folder import RunDetails
from schema.robot.ids import BirthId
from schema.tables.columns import Row
from schema.wire.news import (
    Crewman,
    Departed,
    Level,
    Migrant,
    Newborn,
    News,
    departed,
    levels,
    migrant,
    newborn,
)


class Feed:
    """What there is to tell of one run; a replay of its journal fills it, too.

    Attributes:
        unread: rows that the next call of ``read`` or ``news`` takes.
    """

    def __init__(self, run: str, epoch: int, details: RunDetails) -> None:
        """Know of nothing yet.

        Args:
            run: its name.
            epoch: of the coordinator.
            details: of the run.
        """
        self.unread: list[Record] = []
        self._past = News(
            run, epoch, 0, is_whole=True, experiment=details.name,
            document=details.document,
        )  # fmt: skip
        self._births: dict[BirthId, Newborn] = {}
        self._bodies: list[BirthId] = []
        self._dead: set[BirthId] = set()
        self._born: dict[int, int] = {}
        self._deaths: list[Departed] = []
        self._levels: list[Level] = []
        self._newest: dict[int, Level] = {}
        self._migrants: list[Migrant] = []
        self._new_births: list[Newborn] = []
        self._new_deaths: list[Departed] = []
        self._new_rows: list[Row] = []
        self._new_migrants: list[Migrant] = []
        self._workers: tuple[Crewman, ...] = ()

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
                one = newborn(row, self._born[island])
                self._new_births.append(one)
            case "population":
                self._new_rows.append(dict(row))
            case "deaths":
                self._new_deaths.append(departed(row))
            case "migrations":
                self._new_migrants.append(migrant(row))

    def news(self, workers: tuple[Crewman, ...]) -> News | None:
        """Return what is new since the last call; None if nothing is."""
        self.read()
        fresh = levels(self._new_rows)
        is_new = self._new_births or self._new_deaths or fresh or self._new_migrants
        if not is_new and workers == self._workers:
            return None
        self._past = replace(self._past, sequence=self._past.sequence + 1)
        news = replace(
            self._past,
            is_whole=False,
            document="",
            births=tuple(self._new_births),
            deaths=tuple(self._new_deaths),
            levels=tuple(fresh),
            migrants=tuple(self._new_migrants),
            workers=workers,
        )
        self._remember(news)
        for heard in (
            self._new_births, self._new_deaths, self._new_rows, self._new_migrants
        ):  # fmt: skip
            heard.clear()
        return news

    def whole(self) -> News:
        """Return all that ``news`` has told so far."""
        told = {(level.island, level.births): level for level in self._levels}
        for newest in self._newest.values():
            told[newest.island, newest.births] = newest
        return replace(
            self._past,
            births=tuple(self._births.values()),
            deaths=tuple(self._deaths),
            levels=tuple(told.values()),
            migrants=tuple(self._migrants),
            workers=self._workers,
        )

    def _remember(self, news: News) -> None:
        """Add to the past; of the dead no body is kept."""
        self._workers = news.workers
        self._migrants += news.migrants
        self._deaths += news.deaths
        self._dead.update(gone.birth for gone in news.deaths)
        for level in news.levels:
            self._levels.append(replace(level, members=()))
            self._newest[level.island] = level
        self._births.update((one.birth, one) for one in news.births)
        self._bodies += [one.birth for one in news.births]
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
