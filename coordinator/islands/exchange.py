"""Exchange of one group of islands with the others: its requests and its answers.

A group asks each neighbouring group for all that its islands need of it: when the other
has news, and at intervals, as announcements may be lost. A request that needs nothing
says that the group will never need anything else. So a group knows when all others have
what it has sent, and ends no earlier.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from math import inf
from typing import Protocol

from coordinator.islands.arrivals import check_arrival
from coordinator.islands.events import MigrationEvent, Served, source_of
from coordinator.islands.migration import MigrationEpochs
from coordinator.islands.outbox import Outbox
from schema.errors import MalformedMessage
from schema.experiment.document import Experiment
from schema.experiment.identity import Group
from schema.limits import MIGRANTS_BYTES
from schema.wire.codec import Message, encode, fingerprint
from schema.wire.migration import MigrantsRequest, Needed

ASK_S = 2.0
"""Time between two requests to a group that has announced nothing [s]."""
LEAVE_S = 30.0
"""Time without a word after which a group that needs nothing counts as ended [s]."""
_MOST_FILL = MIGRANTS_BYTES // 4
"""Bytes from which a reply gets no more migrants; those of an island are fewer."""


class MigratingIsland(Protocol):
    """Island or arena, as far as the exchange needs it."""

    epochs: MigrationEpochs | None

    @property
    def is_finished(self) -> bool:
        """It needs no migrants any more."""


class MigrantsReply(Message, frozen=True):
    """Reply to a ``MigrantsRequest``.

    Attributes:
        events: of what is needed, all that has been sent.
        differs: the archipelago has this name, but other births.
    """

    events: tuple[MigrationEvent, ...] = ()
    differs: bool = False


def announcement(archipelago: str, group: int) -> bytes:
    """Return what a group publishes when its islands have sent something."""
    return fingerprint(encode((archipelago, group)))


@dataclass(slots=True)
class _Partner:
    """A group whose islands are neighbours of those here.

    Attributes:
        is_asked: a request is on its way.
        has_news: it is to be asked again at once.
        ask_s: when it is to be asked again in any case [s].
        heard_s: when it was heard of last, or the exchange began [s].
        is_silent: the last request had no reply.
        is_told: it knows that this group needs nothing.
    """

    is_asked: bool = False
    has_news: bool = True
    ask_s: float = -inf
    heard_s: float = -inf
    is_silent: bool = False
    is_told: bool = False


class GroupExchange:
    """State machine of the exchange; time is that of a monotonic clock [s]."""

    def __init__(
        self,
        archipelago: str,
        digest: bytes,
        group: Group,
        *,
        islands: Mapping[int, MigratingIsland],
        experiments: Mapping[int, Experiment],
        outbox: Outbox,
        now_s: float,
    ) -> None:
        """Initialise without requests.

        ``digest``: of what determines the births. ``islands``: those of the group.
        ``experiments``: settings of all islands. ``outbox``: what they have sent.
        """
        self.news = announcement(archipelago, group.number)
        self._archipelago, self._digest, self._group = archipelago, digest, group
        self._islands = islands
        self._experiments = experiments
        self._outbox = outbox
        self._announced = -1
        others = {
            neighbour % group.of
            for island in islands.values()
            if island.epochs is not None
            for neighbour in island.epochs.links.neighbours
        }
        self._partners = {
            number: _Partner(heard_s=now_s)
            for number in sorted(others - {group.number})
        }

    def has_news(self) -> bool:
        """Return whether something is to be announced, once for each news."""
        has_news = self._outbox.size > self._announced
        self._announced = self._outbox.size
        return has_news

    def announced(self, news: bytes) -> None:
        """Take an announcement, of any archipelago."""
        for number, partner in self._partners.items():
            partner.has_news |= news == announcement(self._archipelago, number)

    @property
    def wake_s(self) -> float:
        """When ``requests`` has something to ask [s]."""
        return min(
            (
                -inf if partner.has_news else partner.ask_s
                for partner in self._partners.values()
                if not partner.is_asked
            ),
            default=inf,
        )

    def requests(self, now_s: float) -> list[MigrantsRequest]:
        """Return the requests to send now; ``take`` must get the end of each."""
        requests = []
        if self.wake_s > now_s:
            return []
        needed = self._needed()
        for number, partner in self._partners.items():
            is_due = partner.has_news or now_s >= partner.ask_s
            if partner.is_asked or not is_due:
                continue
            partner.has_news, partner.ask_s = False, now_s + ASK_S
            own = tuple(needed.get(number, ()))
            if own or not partner.is_told:
                partner.is_asked = True
                about = (self._archipelago, self._digest, self._group.number)
                requests.append(MigrantsRequest(*about, number, own))
        return requests

    def _needed(self) -> dict[int, list[Needed]]:
        needed: dict[int, list[Needed]] = {}
        for target, island in sorted(self._islands.items()):
            if island.epochs is None or island.is_finished:
                continue
            for source, epoch in sorted(island.epochs.next_epochs.items()):
                if source not in self._islands:
                    each = Needed(source, target, epoch)
                    needed.setdefault(source % self._group.of, []).append(each)
        return needed

    def take(
        self,
        request: MigrantsRequest,
        replies: Sequence[tuple[str, MigrantsReply]],
        now_s: float,
    ) -> tuple[list[MigrationEvent], list[tuple[str, str]]]:
        """Take the replies to a request, each with the name of its coordinator.

        Where coordinators of the same group differ, neither is believed.

        Returns:
            Events for the journal and then for the islands; names of coordinators, and
            why their replies are not used.
        """
        partner, faults = self._partners[request.to], list[tuple[str, str]]()
        partner.is_asked = False
        partner.is_silent = not replies
        valid: dict[tuple[int, int], list[MigrationEvent]] = {}
        for name, reply in replies:
            try:
                for each in self._checked(request, reply):
                    known = valid.setdefault((source_of(each), each.island), [])
                    known += [each] * (each not in known)
            except MalformedMessage as error:
                faults.append((name, str(error)))
                continue
            partner.heard_s = now_s
            partner.is_told |= not request.needed
        taken: list[MigrationEvent] = []
        for (source, island), events in valid.items():
            if len(events) > 1:
                why = f"{len(replies)} coordinators differ about island {source}"
                faults.extend((name, why) for name, _ in replies)
            elif not self._islands[island].is_finished:
                taken.append(events[0])
        # It may have sent more than the epoch that was needed, or than fits.
        partner.has_news |= bool(taken)
        return taken, faults

    def _checked(
        self, request: MigrantsRequest, reply: MigrantsReply
    ) -> Iterable[MigrationEvent]:
        """Return the events of a reply; ``MalformedMessage`` if one is not believed."""
        if reply.differs:
            raise MalformedMessage(
                f"group {request.to} of archipelago {request.archipelago} has another "
                "document, seed, repeat or number of groups"
            )
        open_ = {(each.source, each.target): each for each in request.needed}
        for event in reply.events:
            needed = open_.pop((source_of(event), event.island), None)
            if needed is None:
                raise MalformedMessage("migrants that no island needs")
            epochs = self._islands[event.island].epochs
            assert epochs is not None
            check_arrival(event, needed, epochs.links, self._experiments)
        return reply.events

    def answer(
        self, request: MigrantsRequest, now_s: float
    ) -> tuple[MigrantsReply | None, list[Served]]:
        """Return the reply to a request, None for none; and events for the journal.

        The journal must have these before the reply is sent.
        """
        partner = self._partners.get(request.by)
        about = (request.archipelago, request.to)
        if about != (self._archipelago, self._group.number) or partner is None:
            return None, []
        if request.digest != self._digest:
            return MigrantsReply(differs=True), []
        partner.heard_s = now_s
        served: list[Served] = []
        if request.needed:
            # Also of a group that has lost its run and begins again.
            self._outbox.served.discard(request.by)
        elif request.by not in self._outbox.served:
            served = [Served(request.by)]
        events: list[MigrationEvent] = []
        room = _MOST_FILL
        for each in request.needed:
            event = self._outbox.get(each.source, each.target, each.epoch)
            if event is not None and room > 0:
                events.append(event)
                room -= len(encode(event))
        return MigrantsReply(tuple(events)), served

    def finish(self) -> None:
        """Tell all groups at once that the islands here need nothing more."""
        for partner in self._partners.values():
            partner.has_news = True

    def is_done(self, now_s: float) -> bool:
        """Return whether no other group needs anything of a group that is finished."""
        return not self.unserved and all(
            not partner.is_asked
            and (partner.is_told or now_s - partner.heard_s > LEAVE_S)
            for partner in self._partners.values()
        )

    @property
    def unserved(self) -> tuple[int, ...]:
        """Groups that may need more of this one."""
        return tuple(each for each in self._partners if each not in self._outbox.served)

    @property
    def silent(self) -> tuple[int, ...]:
        """Groups that did not answer when they were asked last."""
        partners = self._partners.items()
        return tuple(number for number, one in partners if one.is_silent)
