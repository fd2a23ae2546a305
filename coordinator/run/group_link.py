"""Connection of a run to the other groups of islands of its archipelago."""

import time

from coordinator.dispatch.faults import PeerFaults
from coordinator.groups.exchange import GroupExchange, MigrantsReply
from coordinator.network.migration_service import MigrationService
from coordinator.run.loop import Loop
from schema.errors import MalformedMessage
from schema.limits import MIGRANTS_BYTES
from schema.tables.description import RunDetails
from schema.wire.codec import decode, encode, fingerprint


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
            RevolveError: the run cannot continue; see ``Loop.receive``.
        """
        self._now_s = now_s
        exchange, loop, service = self.exchange, self._loop, self._service
        for sent in service.ended():
            replies: list[tuple[str, MigrantsReply]] = []
            for name, data in sent.replies:
                try:
                    replies.append((name, decode(MigrantsReply, data, MIGRANTS_BYTES)))
                except MalformedMessage as error:
                    self._faults.note("migrants", name, str(error))
            taken = exchange.take(sent.request, replies, now_s)
            for name, why in taken.faults:
                self._faults.note("migrants", name, why)
            loop.receive(taken.events)
        if loop.is_finished and not self._was_finished:
            self._was_finished = True
            exchange.finish()
        for query in service.received():
            reply, served = exchange.answer(query.request, now_s)
            loop.receive(served)
            query.reply(None if reply is None else encode(reply))
        for news in service.news():
            exchange.announced(news)
        if exchange.has_news():
            service.announce(exchange.news)
        for request in exchange.requests(now_s):
            service.ask(request)
