"""Connection between coordinators that run groups of islands of one archipelago.

The network's threads only enqueue, and wake the main thread, which calls all methods.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from queue import SimpleQueue
from typing import Any

import zenoh

from coordinator.network.client_service import is_from
from coordinator.network.operator_service import OperatorQuery
from schema.agent.topics import FleetMember, key_of_all, member_of
from schema.errors import MalformedMessage
from schema.limits import MIGRANTS_REQUEST_BYTES, MOST_PEERS, MOST_QUERIES
from schema.wire.codec import encode
from schema.wire.migration import MigrantsRequest

WAIT_S = 3.0
"""Time for the replies to a request; a process that keeps silent delays others [s]."""


@dataclass(slots=True)
class SentRequest:
    """A request to all coordinators, which has ended; the ones of the group replied.

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
        if key == member.migrants and is_from(member, reply):
            self.replies.append((member.name, reply.ok.payload.to_bytes()))


Arrived = SentRequest | OperatorQuery | bytes
"""What came: the end of a request, another coordinator's, or an announcement."""


class MigrationService:
    """Requests for migrants and announcements, in both directions."""

    def __init__(
        self, session: zenoh.Session, me: FleetMember, wake: Callable[[], None]
    ) -> None:
        """Listen in a session; ``wake`` ends the wait of the main thread."""
        self._session, self._me = session, me
        self._wake = wake
        self._arrived: SimpleQueue[Arrived] = SimpleQueue()
        self._declared = (
            session.declare_queryable(
                me.migrants,
                self._enqueue(
                    lambda data, query: OperatorQuery(data, query, me.migrants)
                ),
                complete=True,
            ),
            session.declare_subscriber(
                key_of_all(me.fleet, "coordinator", "announced"),
                self._enqueue(lambda data, _sample: data),
            ),
        )

    def _enqueue(
        self, read: Callable[[bytes, Any], Arrived]
    ) -> "zenoh.handlers.Callback[Any]":
        """Return a callback that keeps messages, unless too many wait."""

        def put(message: Any) -> None:  # noqa: ANN401 - a query or a sample
            payload = message.payload
            is_short = payload is not None and len(payload) <= MIGRANTS_REQUEST_BYTES
            if is_short and self._arrived.qsize() < MOST_QUERIES:
                self._arrived.put(read(payload.to_bytes(), message))
                self._wake()

        return zenoh.handlers.Callback(put, indirect=False)

    @property
    def has_arrived(self) -> bool:
        """Whether something waits for ``arrived``."""
        return not self._arrived.empty()

    def arrived(self) -> list[Arrived]:
        """Return what has come since the last call."""
        return [self._arrived.get() for _ in range(self._arrived.qsize())]

    def announce(self, news: bytes) -> None:
        """Publish an announcement, best effort."""
        self._session.put(self._me.announced, news)

    def ask(self, request: MigrantsRequest) -> None:
        """Send a request; ``arrived`` returns its end, exactly once."""
        sent = SentRequest(request)

        def end() -> None:
            self._arrived.put(sent)
            self._wake()

        self._session.get(
            key_of_all(self._me.fleet, "coordinator", "migrants"),
            zenoh.handlers.Callback(sent.take, end, indirect=False),
            payload=encode(request),
            timeout=WAIT_S,
            target=zenoh.QueryTarget.ALL,
            consolidation=zenoh.ConsolidationMode.NONE,
        )
