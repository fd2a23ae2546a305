"""Records a live run from the network.

Messages are checked before they are shown: any process can publish them.
"""

import threading
import time
from collections import deque
from typing import Any

import numpy as np
import pyarrow as pa

from analysis.viewer.blueprint import layout
from analysis.viewer.entities import recording_name
from analysis.viewer.live import Ended, LiveMessage, LiveSource
from analysis.viewer.output import Output, Window, keep_serving
from analysis.viewer.recording import Recording
from analysis.viewer.scene import Scene, scene_of
from analysis.viewer.show import Show
from schema.agent.log import tell_user
from schema.agent.progress_line import ProgressLine
from schema.errors import (
    InvalidRobot,
    MalformedMessage,
    NetworkError,
    RevolveError,
    counted,
)
from schema.experiment.file import experiment_from_text
from schema.limits import GREATEST_COORDINATE, LONGEST_REASON, LONGEST_WALL_S, printable
from schema.robot.ids import BirthId
from schema.robot.robot import check_body, check_tree
from schema.wire.arena import Live
from schema.wire.poses import PoseArrays
from schema.wire.updates import Update

_LATEST_S = LONGEST_WALL_S
"""Simulated time; the recording has 64 bits of nanoseconds [s]."""


def check_update(news: Update, scene: Scene) -> None:
    """Raise unless all that a message holds can be shown.

    Raises:
        MalformedMessage: an unknown island, a body that breaks the rules of the run, a
            time beyond the limit, a text that is too long.
    """
    islands = {one.birth.island for one in news.births}
    placed: list[Any] = [*news.deaths, *news.levels, *news.migrants, *news.samples]
    islands |= {one.island for one in placed} | {one.to for one in news.migrants}
    if unknown := islands - set(scene.islands):
        raise MalformedMessage(f"update: the run has no island {min(unknown)}")
    dated: list[Any] = [*news.births, *news.deaths, *news.migrants, *news.samples]
    for one in dated:
        if one.sim_time_s is not None and not 0.0 <= one.sim_time_s <= _LATEST_S:
            raise MalformedMessage(
                f"update: times must be in [0, {_LATEST_S:g}] s, got {one.sim_time_s}"
            )
    texts = [gone.reason for gone in news.deaths]
    texts += [text for man in news.workers for text in (man.name, man.platform)]
    if any(len(text) > LONGEST_REASON for text in texts):
        raise MalformedMessage(
            f"update: texts must have <= {LONGEST_REASON} characters"
        )
    for body in (one.body for one in news.births if one.body is not None):
        try:
            check_tree(body)
            check_body(body, scene.space)
        except InvalidRobot as error:
            raise MalformedMessage(f"update: {error}") from None


def received_poses(live: Live, scene: Scene) -> pa.Table:
    """Return the poses of a message.

    Raises:
        MalformedMessage: no columns of poses; of no arena; times or numbers that are
            not finite, beyond their limits, or times that descend.
    """
    if live.shard not in scene.arenas:
        raise MalformedMessage(f"poses: the run has no arena {live.shard}")
    poses = PoseArrays.received(live.advance.poses)
    times = poses.times_s
    if not ((times >= 0.0) & (times <= _LATEST_S)).all() or (np.diff(times) < 0).any():
        raise MalformedMessage(
            f"poses: times must ascend from 0 to {_LATEST_S:g} s at most"
        )
    if not (np.abs(poses.cores[:, :3]) <= GREATEST_COORDINATE).all():
        raise MalformedMessage("poses: x, y and z must be a finite position")
    if not poses.are_finite:
        raise MalformedMessage("poses: attitudes and angles must be finite")
    return poses.rows()


_POLL_S = 0.2
_PATIENCE_S = 15.0
_SILENT_S = 2.0
_MOST_UNKNOWN = 200
"""Messages with poses of unknown robots that are kept."""


def watch(
    source: LiveSource, output: Output, follow: BirthId | None, stop: threading.Event
) -> None:
    """Record a run until it ends or ``stop`` is set.

    Raises:
        NetworkError: no coordinator sends a run.
        ViewerError: the window cannot be opened.
    """
    scene, messages = _first(source, stop)
    if scene is None:
        if output.file is not None:
            tell_user(f"stopped before a run was received; {output.file} not written")
        return
    news = messages[0]
    assert isinstance(news, Update)
    name = recording_name(news.experiment, news.run.rpartition("/")[2])
    blueprint = layout(scene, follow=follow)
    with Recording(name, blueprint, file=output.file, serve=output.serve) as recording:
        window = Window(output)
        recording.add_scene(scene)
        view = LiveView(Show(recording, scene.space, scene.grid), news.run, scene)
        view.tell(messages)
        with ProgressLine() as progress:
            while not (stop.is_set() or view.has_ended or window.was_closed):
                now_s = time.monotonic()
                if not output.has_window:  # the window shows it, next to a run's bars
                    progress.update(
                        f"recording {name}: {counted(view.births, 'birth')}", now_s
                    )
                view.tell(source.receive(_POLL_S, now_s))
        if dropped := view.dropped + source.dropped:
            tell_user(
                f"dropped {counted(dropped, 'message')}: malformed, or not of this run"
            )
        if view.has_ended:
            tell_user("the run has ended")
        keep_serving(output, window, recording, stop)


def _first(
    source: LiveSource, stop: threading.Event
) -> tuple[Scene | None, list[LiveMessage]]:
    """Wait for a run; return its scene, its complete state and later messages."""
    since_s = time.monotonic()
    has_reported = False
    messages: list[LiveMessage] = []
    while not stop.is_set():
        now_s = time.monotonic()
        messages += source.receive(_POLL_S, now_s)
        for index, each in enumerate(messages):
            if isinstance(each, Update) and each.is_whole:
                try:
                    scene = scene_of(experiment_from_text(each.document))
                except RevolveError as error:
                    tell_user(f"{printable(each.run)}: cannot be shown: {error}")
                    source.forget()
                    messages.clear()
                    break
                # Updates that came while its pages travelled may go on from it.
                return scene, [each, *messages[:index], *messages[index + 1 :]]
        if now_s > since_s + _PATIENCE_S:
            raise NetworkError("the coordinator does not send a run")
        if now_s > since_s + _SILENT_S and not has_reported:
            has_reported = True
            tell_user("waiting for the coordinator to send a run")
    return None, []


class LiveView:
    """Records the messages of one run; poses wait until their robot is known.

    Attributes:
        has_ended: the coordinator of the run has left the network.
        dropped: number of messages that cannot be shown.
    """

    def __init__(self, show: Show, run: str, scene: Scene) -> None:
        self.has_ended = False
        self.dropped = 0
        self._scene = scene
        self._births: dict[int, int] = {}
        self._show = show
        self._run = run
        self._unknown: deque[tuple[int, pa.Table]] = deque(maxlen=_MOST_UNKNOWN)

    @property
    def births(self) -> int:
        """Number of births on all islands so far."""
        return sum(self._births.values())

    def tell(self, messages: list[LiveMessage]) -> None:
        """Record messages: births before poses of their robots."""
        news = [each for each in messages if isinstance(each, Update)]
        for one in news:
            try:
                check_update(one, self._scene)
            except MalformedMessage:
                self.dropped += 1
                continue
            # A birth carries the number of births on its island, so that duplicates
            # count once.
            self._births |= {each.birth.island: each.births for each in one.births}
            self._show.tell(one)
        if news:
            waiting, self._unknown = self._unknown, deque(maxlen=_MOST_UNKNOWN)
            for arena, poses in waiting:
                self._move(arena, poses, has_all=False)
        for each in messages:
            if isinstance(each, Live) and each.run == self._run:
                try:
                    poses = received_poses(each, self._scene)
                except MalformedMessage:
                    self.dropped += 1
                    continue
                self._move(each.shard, poses, has_all=not each.is_part)
            self.has_ended = self.has_ended or isinstance(each, Ended)

    def _move(self, arena: int, poses: pa.Table, *, has_all: bool) -> None:
        """Record poses; keep those of unknown robots for later.

        Poses that do not fit their robots are dropped.
        """
        try:
            unknown = self._show.move(arena, poses, has_all=has_all)
        except MalformedMessage:
            self.dropped += 1
            return
        if unknown is not None:
            self._unknown.append((arena, unknown))
