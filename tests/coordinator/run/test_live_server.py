"""Replies to viewers: each gets the whole run, and a stuck one costs no memory."""

import threading
import time
from collections.abc import Callable
from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any, Self

import pytest

from coordinator.dispatch.faults import PeerFaults
from coordinator.network.operator_service import Queries
from coordinator.run.feed import Feed
from coordinator.run.live_server import LiveServer
from coordinator.storage.folder import RunDetails
from schema.limits import MOST_QUERIES
from schema.wire.updates import Update, encode_update

DETAILS = RunDetails("live", 0, 1, "{}")
PATIENCE_S = 20.0


@dataclass
class Viewer:
    """Query of a viewer whose connection may block."""

    gate: threading.Event
    payload: None = None
    replies: list[bytes] = field(default_factory=list)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        """Close nothing."""

    def reply(self, _key: str, data: bytes) -> None:
        assert self.gate.wait(PATIENCE_S)
        self.replies.append(data)

    def drop(self) -> None:
        """Be dropped."""


class Live:
    """A server without agents, and the number of its encodings."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch) -> None:
        self.queries = Queries("key", PeerFaults())
        network: Any = SimpleNamespace(queries=self.queries, has_viewers=False)
        fleet: Any = SimpleNamespace(dispatch=SimpleNamespace(names=lambda _kind: []))
        loop: Any = SimpleNamespace(islands={}, shard_requests=None)
        self.encodings = 0
        monkeypatch.setattr(Feed, "whole", self._counting(Feed.whole))
        self.server = LiveServer(Feed("live", 1, DETAILS), loop, fleet, network)

    def _counting(self, real: Callable[[Feed], Update]) -> Callable[[Feed], Update]:
        def whole(feed: Feed) -> Update:
            self.encodings += 1
            return real(feed)

        return whole

    def ask(self, gate: threading.Event) -> Viewer:
        viewer = Viewer(gate)
        self.queries.add(viewer, "key")  # type: ignore[arg-type]
        return viewer


def until(is_so: Callable[[], bool]) -> None:
    end_s = time.monotonic() + PATIENCE_S
    while not is_so():
        assert time.monotonic() < end_s
        time.sleep(0.001)


def test_each_viewer_gets_the_whole_run_once(monkeypatch: pytest.MonkeyPatch) -> None:
    live, gate = Live(monkeypatch), threading.Event()
    gate.set()
    viewers = [live.ask(gate) for _ in range(3)]
    live.server.serve(1.0)
    late = live.ask(gate)
    live.server.serve(1.5)
    until(lambda: all(len(each.replies) == 1 for each in viewers))
    assert late.replies == []
    live.server.close()
    until(lambda: len(late.replies) == 1)
    assert live.encodings == 2
    whole = Feed("live", 1, DETAILS).whole()
    assert viewers[0].replies == [encode_update(whole)]


def test_nothing_is_encoded_behind_a_stuck_viewer(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    live, gate = Live(monkeypatch), threading.Event()
    viewers = []
    for second in range(2 * MOST_QUERIES):
        viewers.append(live.ask(gate))
        live.server.serve(float(second))
    assert live.encodings == 1
    gate.set()
    until(lambda: len(viewers[0].replies) == 1)
    until(live.server._is_idle.is_set)
    live.server.serve(1e4)
    until(lambda: len(viewers[1].replies) == 1)
    assert live.encodings == 2
    live.server.close()
    # Beyond the limit they are dropped.
    until(lambda: sum(len(each.replies) for each in viewers) == 1 + MOST_QUERIES)
