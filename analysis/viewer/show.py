"""Records a run, from live messages or from its tables.

``Show`` keeps the robots that are shown, so that a robot's boxes appear with its first
pose and disappear at its death. Data that arrives twice is recorded once.
"""

from bisect import bisect_right, insort
from collections import defaultdict
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache, partial
from math import inf
from operator import itemgetter

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from analysis.render.overlay import Overlay
from analysis.viewer.body import BoxModel, Float32s, box_model, place_rows
from analysis.viewer.entities import TimePoint, robot_path
from analysis.viewer.populations import ArchiveMaps, Gallery, Lineage
from analysis.viewer.recording import Recording
from analysis.viewer.replay import frames_of, rows_by_robot
from schema.experiment.grid import Grid
from schema.parts import BodySpace
from schema.robot.ids import BirthId
from schema.robot.robot import Robot
from schema.wire.updates import Birth, Level, Migrant, RecordedDeath, Update, WorkerInfo

_REPEAT_S = 10.0
"""Interval at which a robot's boxes are logged again: a server drops its oldest data
[s]."""
_PER_M, _PER_TURN = 2048.0, 1024.0
"""Resolution of places and attitudes, 0.5 mm and 0.1 degrees: saves a third of the
size."""
_BLINK_S = 0.1
"""A robot without further poses is removed this long after the last one [s]."""


@dataclass(slots=True)
class _ShownRobot:
    """A robot in an arena: its entity, times of its last boxes and pose [s]."""

    path: str
    drawn_s: float
    seen_s: float
    is_gone: bool = False


class Show:
    """One run in one recording."""

    def __init__(
        self, recording: Recording, space: BodySpace, grid: Grid | None = None
    ) -> None:
        self._recording = recording
        self._lineage = Lineage(recording)
        self._gallery = Gallery(recording)
        self._archives = ArchiveMaps(recording, grid) if grid else None
        self._space = space
        # Each model is made at the first call.
        self._models: dict[BirthId, Callable[[], BoxModel]] = {}
        # Number and time of each birth on an island [s], ascending.
        self._clocks = defaultdict[int, list[tuple[int, float]]](lambda: [(0, -inf)])
        self._shown: dict[tuple[int, BirthId], _ShownRobot] = {}
        self._gone: dict[tuple[int, BirthId], RecordedDeath] = {}
        self._levels: set[tuple[int, int]] = set()
        self._moves: set[tuple[BirthId, int, int]] = set()
        self._workers: tuple[WorkerInfo, ...] | None = None
        self._overlays: defaultdict[int, Overlay] = defaultdict(Overlay)

    def tell(self, news: Update) -> None:
        """Record everything new in a message."""
        came: list[Birth | Level] = [*news.births, *news.levels]
        for message in sorted(came, key=lambda message: message.births):
            if isinstance(message, Birth):
                self._born(message)
            else:
                self._level(message)
        # A birth at the time of a death comes before the death.
        for gone in sorted(news.deaths, key=lambda gone: gone.births):
            self._departed(gone)
        for migrant in news.migrants:
            self._migrated(migrant)
        if self._archives is not None:
            self._archives.add(news.elites, self._birth_time)
        for sample in news.samples:
            self._overlays[sample.island].samples.append(sample)
        self._lineage.draw()
        if news.workers != self._workers:
            self._workers = news.workers
            self._recording.process_pool(_process_pool(news.workers))

    def move(
        self, arena: int, poses: pa.Table, *, has_all: bool = True
    ) -> pa.Table | None:
        """Record poses of the robots in an arena, rows of the poses table by time.

        If all have a row, the others are removed.

        Returns:
            Poses of robots whose births are not known yet; None if there are none.
        """
        unknown: list[pa.Table] = []
        shown: set[BirthId] = set()
        for birth, rows in rows_by_robot(poses):
            shown.add(birth)
            if birth not in self._models:
                unknown.append(rows)
                continue
            times = rows["sim_time_s"].to_numpy()
            path = self._settle(arena, birth, times)
            centres, attitudes = place_rows(self._models[birth](), rows)
            births = self._births_at(arena, times)
            coarse = _coarse(centres, _PER_M), _coarse(attitudes, _PER_TURN)
            self._recording.log_poses(path, times, births, *coarse)
        if has_all:
            if arena in self._overlays:
                self._lay_over(arena, self._overlays[arena], poses)
            self._remove_absent(arena, shown)
        return pa.concat_tables(unknown) if unknown else None

    def _lay_over(self, arena: int, overlay: Overlay, poses: pa.Table) -> None:
        """Record what the rules of an arena keep, at the times of its poses."""
        frames = frames_of(poses)
        for time_s, places in frames.items():
            when = self._at(arena, time_s)
            # Boxes may just have been logged again.
            if overlay.advance(time_s) or time_s == min(frames):
                for birth in overlay.colours.keys() & places.keys():
                    path = robot_path(arena, birth)
                    self._recording.paint(path, overlay.colours[birth], when)
            rods = overlay.rods(time_s, places)
            self._recording.overlay(arena, rods, overlay.text, when)

    def _at(self, island: int, time_s: float) -> TimePoint:
        """Return a time of an arena, with its births so far."""
        return TimePoint(time_s, int(self._births_at(island, np.array([time_s]))[0]))

    def _births_at(
        self, island: int, times_s: npt.NDArray[np.float64]
    ) -> npt.NDArray[np.int64]:
        clock, born_s = self._clocks[island], itemgetter(1)
        after = (bisect_right(clock, time_s, key=born_s) for time_s in times_s)
        return np.array([clock[at - 1][0] for at in after], dtype=np.int64)

    def _settle(
        self, arena: int, birth: BirthId, times_s: npt.NDArray[np.float64]
    ) -> str:
        """Log a robot's boxes in an arena if needed; return its path."""
        key, path = (arena, birth), robot_path(arena, birth)
        first_s, last_s = float(times_s[0]), float(times_s[-1])
        robot = self._shown.get(key)
        if robot is None or first_s - robot.drawn_s >= _REPEAT_S:
            when = self._at(arena, first_s)
            self._recording.log_boxes(path, self._models[birth](), when)
            was_gone = robot is not None and robot.is_gone
            self._shown[key] = _ShownRobot(path, first_s, last_s, was_gone)
        self._shown[key].seen_s = last_s
        return path

    def _remove_absent(self, arena: int, shown: set[BirthId]) -> None:
        here = [key for key in self._shown if key[0] == arena]
        for key in here:
            if key in self._gone:
                self._leave(self._gone[key])
            elif key[1] not in shown:
                robot = self._shown[key]
                births = self._at(arena, robot.seen_s).births
                when = TimePoint(robot.seen_s + _BLINK_S, births)
                self._recording.remove(robot.path, when)
            if key[1] not in shown:
                del self._shown[key]

    def _leave(self, gone: RecordedDeath) -> None:
        robot = self._shown.get((gone.island, gone.birth))
        if robot is not None and not robot.is_gone:
            robot.is_gone = True
            # A robot that is born at the same time counts as born before the death.
            when = self._at(gone.island, gone.sim_time_s)
            self._recording.remove(robot.path, when)

    def _born(self, one: Birth) -> None:
        if one.body is not None:
            body = Robot(one.body)
            model = cache(partial(box_model, body, self._space, is_plain=True))
            self._models.setdefault(one.birth, model)
        if not self._lineage.add(one):
            return
        if one.sim_time_s is not None:
            # After a lost message births arrive late.
            insort(self._clocks[one.birth.island], (one.births, one.sim_time_s))
        parents = " and ".join(parent.name for parent in one.parents)
        text = f"{one.birth.name} is born{' to ' if parents else ''}{parents}"
        self._recording.log_line(text, TimePoint(one.sim_time_s, one.births), "INFO")

    def _departed(self, gone: RecordedDeath) -> None:
        if (gone.island, gone.birth) in self._gone:
            return
        self._gone[gone.island, gone.birth] = gone
        self._leave(gone)
        self._lineage.remove(gone)
        text = f"{gone.birth.name} is gone: {gone.reason}"
        self._recording.log_line(text, TimePoint(gone.sim_time_s, gone.births), "WARN")

    def _level(self, level: Level) -> None:
        if (level.island, level.births) in self._levels:
            return
        self._levels.add((level.island, level.births))
        when = self._birth_time(level.island, level.births)
        fitness = (level.mean, level.best) if level.judged else ()
        self._recording.level(level.island, when, level.size, fitness)
        if when.sim_time_s is None and level.members:
            self._lineage.keep(level)
            self._gallery.show(level, self._models)

    def _birth_time(self, island: int, births: int) -> TimePoint:
        """Return the time of a number of births: in an arena that of the last one."""
        clock = self._clocks[island]
        known, born_s = clock[bisect_right(clock, (births, inf)) - 1]
        return TimePoint(born_s if known == births else None, births)

    def _migrated(self, migrant: Migrant) -> None:
        key = (migrant.birth, migrant.to, migrant.epoch)
        if key in self._moves:
            return
        self._moves.add(key)
        name = migrant.birth.name
        text = f"{name} migrates from island {migrant.island} to {migrant.to}"
        when = TimePoint(migrant.sim_time_s, migrant.births)
        self._recording.log_line(text, when, "INFO")


def _coarse(numbers: Float32s, grains: float) -> Float32s:
    """Return numbers rounded to ``1 / grains``, which take less room in a file."""
    return (np.round(numbers * grains) / grains).astype(np.float32)


def _process_pool(workers: tuple[WorkerInfo, ...]) -> str:
    lines = ["| worker | platform | arenas |", "|---|---|---|"]
    for man in workers:
        arenas = ", ".join(map(str, man.shards)) or "-"
        lines.append(f"| {man.name} | {man.platform} | {arenas} |")
    return "\n".join(lines)
