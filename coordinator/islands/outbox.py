"""Migrants and closings for islands of other groups.

A replay of the journal fills it again, so that they can be asked for as long as the run
exists.
"""

from collections import defaultdict

from coordinator.islands.events import MigrationEvent, NeighbourClosed, source_of


class Outbox:
    """What the islands of a group have sent to islands of other groups.

    Attributes:
        size: number of events in it; it only grows.
        served: groups that need no more of it.
        sent: its events by source and target, in order.
    """

    def __init__(self) -> None:
        self.size = 0
        self.served: set[int] = set()
        self.sent: dict[tuple[int, int], list[MigrationEvent]] = defaultdict(list)

    def put(self, event: MigrationEvent) -> None:
        """Add what an island sent: its migrants epoch by epoch, at last its closing."""
        self.sent[source_of(event), event.island].append(event)
        self.size += 1

    def get(self, source: int, target: int, epoch: int) -> MigrationEvent | None:
        """Return the migrants of an epoch, or the closing that came before it.

        None if the source has not sent them yet.
        """
        sent = self.sent.get((source, target), [])
        if epoch < len(sent):
            return sent[epoch]
        is_closed = sent and isinstance(sent[-1], NeighbourClosed)
        return sent[-1] if is_closed else None
