"""Connection between coordinators that run groups of islands of one archipelago.

The network's threads only enqueue, and wake the main thread, which calls all methods.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from queue import Empty, SimpleQueue
from typing import TypeVar

import zenoh

from coordinator.dispatch.faults import PeerFaults
from schema.agent.topics import Member, announced_by_all, member_of, migrants_of_all
from schema.errors import MalformedMessage
from schema.limits import MIGRANTS_REQUEST_BYTES, MOST_PEERS, MOST_QUERIES
from schema.wire.codec import decode, encode
from schema.wire.migration import GroupNews, MigrantsRequest

T = TypeVar("T")
WAIT_S = 3.0
"""Time for the replies to a request; a process that keeps silent delays others [s]."""


@dataclass(slots=True)
class SentRequest:
    """A request to all coordinators; the one that runs the group replies.

    Attributes:
        replies: bytes, each with the name of the coordinator that sent them.
    """

    request: MigrantsRequest
    replies: list[tuple[str, bytes]] = field(default_factory=list)

    def take(self, reply: zenoh.Reply) -> None:
        """Keep a reply that a coordinator sent by its own key."""
        if reply.ok is None or len(self.replies) >= MOST_PEERS:
            return
        key = str(reply.ok.key_expr)
        try:
            member = member_of(f"{key.rpartition('/')[0]}/alive")
        except MalformedMessage:
            return
        replier = reply.replier_id
        is_own = replier is not None and str(replier.zid) == member.session
        if is_own and key == member.migrants:
            self.replies.append((member.name, reply.ok.payload.to_bytes()))


@dataclass(frozen=True, slots=True)
class ReceivedRequest:
    """A request of another coordinator; call ``reply`` once."""

    request: MigrantsRequest
    query: zenoh.Query
    key: str

    def reply(self, data: bytes | None) -> None:
        """Reply, or with None do not."""
        with self.query as query:
            if data is not None:
                query.reply(self.key, data)


class MigrationService:
    """Requests for migrants and announcements, in both directions."""

    def __init__(
        self,
        session: zenoh.Session,
        me: Member,
        wake: Callable[[], None],
        faults: PeerFaults,
    ) -> None:
        """Listen in a session; ``wake`` ends the wait of the main thread."""
        self._session, self._me = session, me
        self._wake = wake
        self._faults = faults
        self._queries: SimpleQueue[zenoh.Query] = SimpleQueue()
        self._samples: SimpleQueue[zenoh.Sample] = SimpleQueue()
        self._ended: SimpleQueue[SentRequest] = SimpleQueue()
        self._declared = (
            session.declare_queryable(
                me.migrants, self._enqueue(self._queries), complete=True
            ),
            session.declare_subscriber(
                announced_by_all(me.fleet), self._enqueue(self._samples)
            ),
        )

    def _enqueue(self, queue: "SimpleQueue[T]") -> "zenoh.handlers.Callback[T]":
        """Return a callback that keeps what comes, unless too much of it waits."""

        def put(one: T) -> None:
            if queue.qsize() < MOST_QUERIES:
                queue.put(one)
                self._wake()

        return zenoh.handlers.Callback(put, indirect=False)

    @property
    def has_arrived(self) -> bool:
        """Whether something waits for the main thread."""
        queues = (self._queries, self._samples, self._ended)
        return not all(queue.empty() for queue in queues)

    def announce(self, news: GroupNews) -> None:
        """Publish an announcement, best effort."""
        self._session.put(self._me.announced, encode(news))

    def ask(self, request: MigrantsRequest) -> None:
        """Send a request; ``ended`` returns it, exactly once."""
        sent = SentRequest(request)

        def end() -> None:
            self._ended.put(sent)
            self._wake()

        self._session.get(
            migrants_of_all(self._me.fleet),
            zenoh.handlers.Callback(sent.take, end, indirect=False),
            payload=encode(request),
            timeout=WAIT_S,
            target=zenoh.QueryTarget.ALL,
            consolidation=zenoh.ConsolidationMode.NONE,
        )

    def ended(self) -> list[SentRequest]:
        """Return the requests that have ended since the last call."""
        return _taken(self._ended)

    def received(self) -> list[ReceivedRequest]:
        """Return the requests of other coordinators since the last call."""
        received: list[ReceivedRequest] = []
        for query in _taken(self._queries):
            payload = query.payload
            data = b"" if payload is None else payload.to_bytes()
            try:
                request = decode(MigrantsRequest, data, MIGRANTS_REQUEST_BYTES)
            except MalformedMessage as error:
                self._faults.note("malformed", "coordinators", str(error))
                query.drop()  # type: ignore[no-untyped-call]
            else:
                received.append(ReceivedRequest(request, query, self._me.migrants))
        return received

    def news(self) -> list[GroupNews]:
        """Return the announcements since the last call."""
        news: list[GroupNews] = []
        for sample in _taken(self._samples):
            try:
                data = sample.payload.to_bytes()
                news.append(decode(GroupNews, data, MIGRANTS_REQUEST_BYTES))
            except MalformedMessage as error:
                self._faults.note("malformed", "coordinators", str(error))
        return news


def _taken(queue: "SimpleQueue[T]") -> list[T]:
    """Return what waits in a queue."""
    found: list[T] = []
    try:
        while len(found) < MOST_QUERIES:
            found.append(queue.get_nowait())
    except Empty:
        pass
    return found
