"""Connection of a run to the other groups of islands of its archipelago."""

import time

from coordinator.dispatch.faults import PeerFaults
from coordinator.islands.exchange import GroupExchange, MigrantsReply
from coordinator.network.migration_service import MigrationService, SentRequest
from coordinator.network.operator_service import OperatorQuery
from coordinator.run.loop import Loop
from schema.errors import MalformedMessage
from schema.limits import MIGRANTS_BYTES, MIGRANTS_REQUEST_BYTES
from schema.tables.description import RunDetails
from schema.wire.codec import decode, encode, fingerprint
from schema.wire.migration import MigrantsRequest


def births_digest(details: RunDetails) -> bytes:
    """Return 8 bytes that all groups of an archipelago have in common.

    Document, seed, repeat and number of groups determine them, and no other
    archipelago has the same by chance.
    """
    return fingerprint(
        encode((details.document, details.seed, details.run, details.group.of))
    )


class GroupLink:
    """What a run sends to the coordinators of other groups, and takes from them."""

    def __init__(
        self,
        details: RunDetails,
        loop: Loop,
        service: MigrationService,
        faults: PeerFaults,
    ) -> None:
        """Connect the islands of a loop that has not started."""
        self._loop, self._service, self._faults = loop, service, faults
        self._now_s = time.monotonic()
        self._was_finished = False
        self.exchange = GroupExchange(
            details.archipelago,
            births_digest(details),
            details.group,
            islands=loop.islands,
            experiments=loop.context.experiments,
            outbox=loop.outbox,
            now_s=self._now_s,
        )

    @property
    def wake_s(self) -> float:
        """When there is something to do [s]."""
        return -1.0 if self._service.has_arrived else self.exchange.wake_s

    @property
    def is_done(self) -> bool:
        """No other group needs anything of this one, which is finished."""
        return self.exchange.is_done(self._now_s)

    def act(self, now_s: float) -> None:
        """Answer other groups, take what they sent, and ask for more.

        Raises:
            RevolveError: the run cannot continue; see ``Loop.act``.
        """
        self._now_s = now_s
        exchange, service = self.exchange, self._service
        for each in service.arrived():
            if isinstance(each, SentRequest):
                self._take(each)
            elif isinstance(each, OperatorQuery):
                self._answer(each)
            else:
                exchange.announced(each)
        if self._loop.is_finished and not self._was_finished:
            self._was_finished = True
            exchange.finish()
        if exchange.has_news():
            service.announce(exchange.news)
        for request in exchange.requests(now_s):
            service.ask(request)

    def _take(self, sent: SentRequest) -> None:
        replies: list[tuple[str, MigrantsReply]] = []
        faults: list[tuple[str, str]] = []
        for name, data in sent.replies:
            try:
                replies.append((name, decode(MigrantsReply, data, MIGRANTS_BYTES)))
            except MalformedMessage as error:
                faults.append((name, str(error)))
        events, false = self.exchange.take(sent.request, replies, self._now_s)
        for name, why in (*faults, *false):
            self._faults.note("migrants", name, why)
        self._loop.take(events)

    def _answer(self, query: OperatorQuery) -> None:
        replies: list[bytes] = []
        try:
            request = decode(MigrantsRequest, query.data, MIGRANTS_REQUEST_BYTES)
            reply, served = self.exchange.answer(request, self._now_s)
            self._loop.take(served)
            replies += [] if reply is None else [encode(reply)]
        except MalformedMessage as error:
            self._faults.note("malformed", "coordinators", str(error))
        query.reply(*replies)
