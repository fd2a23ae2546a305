"""Watching a run while it lives: from the network into a recording."""

import threading
import time
from collections import deque

import pyarrow as pa

from analysis.progress import ProgressLine
from analysis.viewer.blueprint import layout
from analysis.viewer.live import Ended, LiveSource, Told
from analysis.viewer.output import Output, Window, keep_serving
from analysis.viewer.recording import Recording
from analysis.viewer.scene import scene_of
from analysis.viewer.show import Show
from schema.agent.service import tell_user
from schema.errors import MalformedMessage, NetworkError
from schema.experiment.file import experiment_from_text
from schema.robot.ids import BirthId
from schema.tables.columns import read_columns
from schema.wire.arena_codec import Live
from schema.wire.updates import Update

_POLL_S = 0.2
_PATIENCE_S = 15.0
_SILENT_S = 2.0
_STRANGERS = 200
"""Messages with poses of robots not yet known that are kept."""


def watch(
    source: LiveSource,
    output: Output,
    follow: tuple[int, BirthId] | None,
    stop: threading.Event,
) -> None:
    """Record a run until it ends, or until told to stop.

    Args:
        source: opened.
        output: where the recording goes.
        follow: island and robot that the camera follows.
        stop: ends it.

    Raises:
        NetworkError: no coordinator tells of a run.
        ViewerError: the window cannot be opened.
    """
    news, rest = _first(source, stop)
    if news is None:
        if output.file is not None:
            tell_user(f"stopped before a run was told of: no {output.file} is written")
        return
    scene = scene_of(experiment_from_text(news.document))
    name = f"{news.experiment}-{news.run.rpartition('/')[2]}"
    blueprint = layout(
        scene.islands,
        extent_m=scene.extent_m,
        arenas=scene.arenas,
        follow=follow,
    )
    with Recording(name, blueprint, file=output.file, serve=output.serve) as recording:
        window = Window(output)
        recording.add_scene(scene)
        view = LiveView(Show(recording, scene.space), news.run)
        view.tell([news, *rest])
        with ProgressLine() as course:
            while not (stop.is_set() or view.has_ended or window.was_closed):
                now_s = time.monotonic()
                if not output.has_window:  # it shows all, and a run's bars may be here
                    born = view.births
                    course.tell(f"watching {name}: {born} births so far", now_s)
                view.tell(source.receive(_POLL_S, now_s))
        if view.has_ended:
            tell_user("the run has ended")
        keep_serving(output, window, recording, stop)


def _first(
    source: LiveSource, stop: threading.Event
) -> tuple[Update | None, list[Told]]:
    """Wait for all that has happened so far; return it, and what came behind it."""
    since_s = time.monotonic()
    has_said = False
    while not stop.is_set():
        now_s = time.monotonic()
        told = source.receive(_POLL_S, now_s)
        for index, each in enumerate(told):
            if isinstance(each, Update) and each.is_whole:
                return each, told[index + 1 :]
        if now_s > since_s + _PATIENCE_S:
            raise NetworkError("the coordinator does not tell of a run")
        if now_s > since_s + _SILENT_S and not has_said:
            has_said = True
            tell_user("waiting to be told of a run")
    return None, []


class LiveView:
    """Shows what is told of one run; poses wait until their robot is known.

    Attributes:
        has_ended: nobody tells of the run any more.
    """

    def __init__(self, show: Show, run: str) -> None:
        """Watch a run."""
        self.has_ended = False
        self._births: dict[int, int] = {}
        self._show = show
        self._run = run
        self._unknown: deque[tuple[int, pa.Table]] = deque(maxlen=_STRANGERS)

    @property
    def births(self) -> int:
        """How many were born on all islands so far."""
        return sum(self._births.values())

    def tell(self, told: list[Told]) -> None:
        """Show what came, news before poses: births before their robots."""
        news = [each for each in told if isinstance(each, Update)]
        for one in news:
            # What came twice counts once: each birth says how many there were.
            self._births |= {each.birth.island: each.births for each in one.births}
            self._show.tell(one)
        if news:
            waiting, self._unknown = self._unknown, deque(maxlen=_STRANGERS)
            for arena, poses in waiting:
                self._move(arena, poses, has_all=False)
        for each in told:
            if isinstance(each, Live) and each.run == self._run:
                try:
                    poses = read_columns("poses", each.advance.poses)
                except MalformedMessage:
                    continue
                self._move(each.shard, poses, has_all=True)
            self.has_ended = self.has_ended or isinstance(each, Ended)

    def _move(self, arena: int, poses: pa.Table, *, has_all: bool) -> None:
        """Show poses; put those aside whose robots have not been told of."""
        if unknown := self._show.move(arena, poses, has_all=has_all):
            self._unknown.append((arena, poses_of(poses, unknown)))


def poses_of(poses: pa.Table, births: list[BirthId]) -> pa.Table:
    """Return those rows of the poses table that are about some robots."""
    wanted = set(births)
    islands = poses["island"].to_pylist()
    numbers = poses["birth"].to_pylist()
    keep = [BirthId(*each) in wanted for each in zip(islands, numbers, strict=True)]
    return poses.filter(pa.array(keep))
