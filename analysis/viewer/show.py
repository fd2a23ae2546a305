"""Puts what is told of a run, live or from its tables, into a recording.

Who lives where is kept here, so that a robot's boxes come with its first pose, and
go with its death; whatever is told twice is shown once.
"""

from dataclasses import dataclass, field

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from analysis.viewer.body import Float32s, place_rows
from analysis.viewer.entities import PoseBatch, TimePoint, robot_path
from analysis.viewer.gallery import Gallery
from analysis.viewer.lineage import Lineage
from analysis.viewer.looks import BoxModels, rows_by_robot
from analysis.viewer.recording import Recording
from schema.parts import BodySpace
from schema.robot.ids import BirthId
from schema.wire.codec import decode_body
from schema.wire.updates import Birth, Death, Level, Migrant, Update, WorkerInfo

_REPEAT_S = 10.0
"""A server forgets its oldest; a robot's boxes are told again every so often [s]."""
_PER_M, _PER_TURN = 2048.0, 1024.0
"""Half a millimetre and a tenth of a degree are not seen: a third less to store."""
_BLINK_S = 0.1
"""Who is not told of any more vanishes so long after the last pose [s]."""


@dataclass(slots=True)
class _Clock:
    """When births happened on one island: times [s], ascending."""

    times_s: list[float] = field(default_factory=list)
    births: list[int] = field(default_factory=list)

    def births_at(self, times_s: npt.NDArray[np.float64]) -> npt.NDArray[np.int64]:
        """Return how many had been born at some times."""
        after = np.searchsorted(self.times_s, times_s, side="right")
        return np.array([0, *self.births], dtype=np.int64)[after]

    def when(self, births: int) -> TimePoint:
        """Return the moment of a birth by its number on the island, from 1."""
        index = int(np.searchsorted(self.births, births))
        if index < len(self.births) and self.births[index] == births:
            return TimePoint(self.times_s[index], births)
        return TimePoint(None, births)


@dataclass(slots=True)
class _ShownRobot:
    """A robot that is shown in an arena.

    ``drawn_s`` is when its boxes were told last, ``seen_s`` its last pose's time.
    """

    path: str
    drawn_s: float
    seen_s: float
    is_gone: bool = False


class Show:
    """One run in one recording."""

    def __init__(self, recording: Recording, space: BodySpace) -> None:
        """Show nothing yet.

        Args:
            recording: to fill.
            space: the part types.
        """
        self._recording = recording
        self._lineage = Lineage(recording)
        self._gallery = Gallery(recording)
        self._models = BoxModels(space)
        self._clocks: dict[int, _Clock] = {}
        self._shown: dict[tuple[int, BirthId], _ShownRobot] = {}
        self._gone: dict[tuple[int, BirthId], Death] = {}
        self._levels: set[tuple[int, int]] = set()
        self._moves: set[tuple[BirthId, int, int]] = set()
        self._workers: tuple[WorkerInfo, ...] | None = None

    def tell(self, news: Update) -> None:
        """Show what is new in some news."""
        for each in _in_order(news):
            match each:
                case Birth():
                    self._born(each)
                case Level():
                    self._level(each)
                case Death():
                    self._departed(each)
        for migrant in news.migrants:
            self._migrated(migrant)
        self._lineage.draw()
        if news.workers != self._workers:
            self._workers = news.workers
            self._recording.process_pool(_process_pool(news.workers))

    def move(
        self, arena: int, poses: pa.Table, *, has_all: bool = True
    ) -> list[BirthId]:
        """Show robots' poses in an arena.

        Args:
            arena: the number of its island.
            poses: rows of the poses table, by time; ``record`` is not looked at.
            has_all: of all who live there; who is not among them is gone.

        Returns:
            Whose poses were left out, for their births have not been told.
        """
        unknown: list[BirthId] = []
        shown: set[BirthId] = set()
        for birth, rows in rows_by_robot(poses):
            shown.add(birth)
            if birth not in self._models:
                unknown.append(birth)
                continue
            times = rows["sim_time_s"].to_numpy()
            path = self._settle(arena, birth, times)
            centres, attitudes = place_rows(self._models[birth], rows)
            births = self._clock(arena).births_at(times)
            moves = PoseBatch(
                times, births, _coarse(centres, _PER_M), _coarse(attitudes, _PER_TURN)
            )
            self._recording.moved(path, moves)
        if has_all:
            self._take_away(arena, shown)
        return unknown

    def _clock(self, island: int) -> _Clock:
        return self._clocks.setdefault(island, _Clock())

    def _at(self, island: int, time_s: float) -> TimePoint:
        """Return a moment of an arena, with its births until then."""
        births = self._clock(island).births_at(np.array([time_s]))
        return TimePoint(time_s, int(births[0]))

    def _settle(
        self, arena: int, birth: BirthId, times_s: npt.NDArray[np.float64]
    ) -> str:
        """See to it that a robot has its boxes in an arena; return its path."""
        key, path = (arena, birth), robot_path(arena, birth)
        first_s, last_s = float(times_s[0]), float(times_s[-1])
        robot = self._shown.get(key)
        if robot is None or first_s - robot.drawn_s >= _REPEAT_S:
            when = self._at(arena, first_s)
            self._recording.born(path, self._models[birth], when)
            was_gone = robot is not None and robot.is_gone
            self._shown[key] = _ShownRobot(path, first_s, last_s, was_gone)
        self._shown[key].seen_s = last_s
        return path

    def _take_away(self, arena: int, shown: set[BirthId]) -> None:
        """Take the boxes of those away who died, or are not in the arena any more."""
        here = [key for key in self._shown if key[0] == arena]
        for key in here:
            if key in self._gone:
                self._leave(self._gone[key])
            elif key[1] not in shown:
                robot = self._shown.pop(key)
                births = self._at(arena, robot.seen_s).births
                when = TimePoint(robot.seen_s + _BLINK_S, births)
                self._recording.died(robot.path, when)
            if key in self._shown and key[1] not in shown:
                del self._shown[key]

    def _leave(self, gone: Death) -> None:
        """Take a robot's boxes away, once."""
        robot = self._shown.get((gone.island, gone.birth))
        if robot is not None and not robot.is_gone:
            robot.is_gone = True
            # As many births as its last pose has: who is born then counts already.
            when = self._at(gone.island, gone.sim_time_s)
            self._recording.died(robot.path, when)

    def _born(self, one: Birth) -> None:
        if one.body is not None:
            self._models.add(one.birth, decode_body(one.body))
        if not self._lineage.add(one):
            return
        clock = self._clock(one.birth.island)
        if one.sim_time_s is not None:
            clock.times_s.append(one.sim_time_s)
            clock.births.append(one.births)
        whose = " and ".join(f"{each.island}:{each.number}" for each in one.parents)
        text = f"{one.birth.island}:{one.birth.number} is born"
        when = TimePoint(one.sim_time_s, one.births)
        self._recording.said(f"{text} to {whose}" if whose else text, when, "INFO")

    def _departed(self, gone: Death) -> None:
        if (gone.island, gone.birth) in self._gone:
            return
        self._gone[gone.island, gone.birth] = gone
        self._leave(gone)
        self._lineage.remove(gone)
        text = f"{gone.birth.island}:{gone.birth.number} is gone: {gone.reason}"
        self._recording.said(text, TimePoint(gone.sim_time_s, gone.births), "WARN")

    def _level(self, level: Level) -> None:
        if (level.island, level.births) in self._levels:
            return
        self._levels.add((level.island, level.births))
        when = self._clock(level.island).when(level.births)
        fitness = (level.mean, level.best) if level.judged else ()
        self._recording.level(level.island, when, level.size, fitness)
        if when.sim_time_s is None and level.members:
            self._lineage.keep(level)
            self._gallery.show(level, self._models)

    def _migrated(self, migrant: Migrant) -> None:
        key = (migrant.birth, migrant.to, migrant.epoch)
        if key in self._moves:
            return
        self._moves.add(key)
        name = f"{migrant.birth.island}:{migrant.birth.number}"
        text = f"{name} goes from island {migrant.island} to {migrant.to}"
        when = TimePoint(migrant.sim_time_s, migrant.births)
        self._recording.said(text, when, "INFO")


def _coarse(numbers: Float32s, grains: float) -> Float32s:
    """Return numbers of which so many fit into 1; they take less room in a file."""
    return (np.round(numbers * grains) / grains).astype(np.float32)


def _in_order(news: Update) -> list[Birth | Level | Death]:
    """Return births and levels as they came, by births on their island, then deaths.

    Who is born at the instant of a death counts as born by then.
    """
    births = [((one.births, 0), one) for one in news.births]
    levels = [((level.births, 1), level) for level in news.levels]
    keyed: list[tuple[tuple[int, int], Birth | Level]] = [*births, *levels]
    came = [each for _, each in sorted(keyed, key=lambda pair: pair[0])]
    return [*came, *sorted(news.deaths, key=lambda gone: gone.births)]


def _process_pool(workers: tuple[WorkerInfo, ...]) -> str:
    """Return a table of who works, as Markdown."""
    lines = ["| worker | platform | arenas |", "|---|---|---|"]
    for man in workers:
        arenas = ", ".join(map(str, man.shards)) or "-"
        lines.append(f"| {man.name} | {man.platform} | {arenas} |")
    return "\n".join(lines)
