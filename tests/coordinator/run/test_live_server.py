"""Replies to viewers: pages of the state, which cost the run no time."""

from dataclasses import dataclass, field
from types import SimpleNamespace
from typing import Any, Self

import pytest

from coordinator.dispatch.faults import PeerFaults
from coordinator.islands.events import Record
from coordinator.islands.rows import body_rows
from coordinator.network.operator_service import Queries
from coordinator.run import live_server
from coordinator.run.feed import Feed
from coordinator.run.live_server import LiveServer
from schema.limits import MOST_QUERIES, UPDATE_BYTES
from schema.robot.robot import Part, Robot
from schema.tables.description import RunDetails
from schema.wire.codec import decode, encode
from schema.wire.updates import Page, Update, decode_page, pages_of

DETAILS = RunDetails("live", 0, 1, "{}")
CORE = Robot((Part("Core", -1, -1, -1, 0, (0.1, 0.2, 0.3)),))
LONGEST = 65_000
"""What a connection sends at once, without the key [bytes]."""


class Payload(bytes):
    """Bytes with the method of Zenoh's."""

    def to_bytes(self) -> bytes:
        return bytes(self)


@dataclass
class Viewer:
    """Query of a viewer.

    Attributes:
        is_done: the query has ended.
    """

    payload: Payload
    replies: list[bytes] = field(default_factory=list)
    is_done: bool = False

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.is_done = True

    def reply(self, _key: str, data: bytes) -> None:
        self.replies.append(data)

    def drop(self) -> None:
        self.is_done = True

    @property
    def pages(self) -> list[Page]:
        """What it got."""
        return list(map(decode_page, self.replies))


class Live:
    """A server of a run without agents, and the number of its encodings."""

    def __init__(self, monkeypatch: pytest.MonkeyPatch, births: int = 0) -> None:
        self.faults = PeerFaults()
        self.queries = Queries("key", self.faults)
        self.encodings = self.born_yet = 0
        self.feed = Feed("live", 1, DETAILS)
        self.born(births)
        network: Any = SimpleNamespace(
            queries=self.queries, has_viewers=False, faults=self.faults
        )
        fleet: Any = SimpleNamespace(dispatch=SimpleNamespace(names=lambda _kind: []))
        loop: Any = SimpleNamespace(islands={}, shard_requests=None)
        monkeypatch.setattr(live_server, "pages_of", self._counted)
        self.server = LiveServer(self.feed, loop, fleet, network)

    def _counted(self, state: Update) -> list[bytes]:
        self.encodings += 1
        return pages_of(state)

    def born(self, count: int) -> None:
        """Add births."""
        for _ in range(count):
            row: dict[str, Any] = {
                "island": 0, "birth": self.born_yet, "parents": [], "rank": 1,
                "sim_time_s": None, "body": body_rows(CORE),
            }  # fmt: skip
            self.feed.unread.append(Record("births", row))
            self.born_yet += 1

    def ask(self, request: bytes = b"") -> Viewer:
        viewer = Viewer(Payload(request))
        self.queries.add(viewer, "key")  # type: ignore[arg-type]
        return viewer

    def read(self, now_s: float) -> tuple[Update, int]:
        """Return the state as a viewer gets it, and the number of its queries."""
        pages: list[Page] = []
        queries = 0
        while not pages or len(pages) < pages[0].pages:
            sequence = pages[0].sequence if pages else 0
            request = Page(b"", sequence=sequence, page=len(pages))
            viewer = self.ask(encode(request))
            queries += 1
            self.server.serve(now_s + 0.25 * queries)
            assert viewer.is_done
            assert max(map(len, viewer.replies)) < LONGEST
            pages += viewer.pages
        assert [each.page for each in pages] == list(range(len(pages)))
        data = b"".join(each.data for each in pages)
        return decode(Update, data, UPDATE_BYTES), queries


def births(viewer: Viewer) -> int:
    """Return the number of births in a state of one page."""
    (page,) = viewer.pages
    return len(decode(Update, page.data, UPDATE_BYTES).births)


def test_each_viewer_gets_the_state_at_its_time(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    live = Live(monkeypatch)
    viewers = [live.ask() for _ in range(3)]
    live.server.serve(1.0)
    live.born(1)
    late = live.ask()
    live.server.close()
    assert list(map(births, [*viewers, late])) == [0, 0, 0, 1]
    assert live.encodings == 2


def test_a_large_state_travels_in_pages(monkeypatch: pytest.MonkeyPatch) -> None:
    """No message of 12,000 births is longer than a connection sends at once."""
    live = Live(monkeypatch, births=12_000)
    state, queries = live.read(1.0)
    assert [one.birth.number for one in state.births] == list(range(12_000))
    assert state.is_whole
    assert queries > 1


def test_requests_for_the_state_cost_few_encodings(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """A hundred states within two seconds, of a run that goes on."""
    live = Live(monkeypatch, births=1000)
    for turn in range(100):
        live.born(1)
        live.ask()
        live.server.serve(0.02 * turn)
    assert 1 <= live.encodings <= 10


def test_a_viewer_begins_again_when_its_state_is_outdated(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    live = Live(monkeypatch, births=4000)
    first = live.ask()
    live.server.serve(1.0)
    sequence = first.pages[0].sequence
    request = encode(Page(b"", sequence=sequence, page=6))
    live.born(1)
    same, newest = live.ask(request), live.ask()
    live.server.serve(1000.0)
    outdated = live.ask(request)
    live.server.serve(1001.0)
    found = [(one.pages[0].sequence, one.pages[0].page) for one in (same, newest)]
    assert found == [(sequence, 6), (sequence + 1, 0)]
    assert outdated.pages[0] == newest.pages[0]


def test_damaged_requests_are_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    live = Live(monkeypatch)
    damaged, beyond = live.ask(b"\xff"), live.ask(encode(Page(b"", page=10**9)))
    live.server.serve(1.0)
    assert damaged.is_done
    assert damaged.replies == []
    assert beyond.pages[0].page == 0
    assert live.faults.total("malformed") == 1


def test_a_crowd_of_viewers_costs_little(monkeypatch: pytest.MonkeyPatch) -> None:
    live = Live(monkeypatch, births=4000)
    viewers = [live.ask() for _ in range(2 * MOST_QUERIES)]
    live.server.serve(1.0)
    assert live.encodings == 1
    assert live.faults.total("crowd") == MOST_QUERIES
    # What one connection can queue.
    assert sum(len(data) for one in viewers for data in one.replies) <= 2 << 20
