"""Immigrants of an arena, from their arrival until there is room for them."""

from collections.abc import Sequence
from dataclasses import replace

from coordinator.evolution.selection import Individual
from coordinator.islands.events import Emigrate, MigrationEvent
from coordinator.islands.migration import MigrationEpochs
from schema.robot.ids import BirthId


class ImmigrantQueue:
    """Those who leave an arena, and those who wait for room in it.

    Whoever leaves is an empty place: the next immigrants take it, and nobody makes
    room for them.

    Attributes:
        queue: who waits, the first to come first.
        settled: how many immigrants have been let in.
    """

    def __init__(self, epochs: MigrationEpochs) -> None:
        """Expect nobody."""
        self.queue: list[Individual] = []
        self.settled = 0
        self._epochs = epochs
        self._empty = 0

    @property
    def is_waiting(self) -> bool:
        """The arena has sent its migrants, and waits for those of others."""
        return self._epochs.is_waiting

    @property
    def is_complete(self) -> bool:
        """All that it waits for is there."""
        return self._epochs.is_complete

    @property
    def is_hopeful(self) -> bool:
        """Somebody waits for room, or may come at the next exchange."""
        return bool(self.queue) or self._epochs.has_sources

    @property
    def neighbours(self) -> tuple[int, ...]:
        """Whom the arena is connected with."""
        return self._epochs.links.neighbours

    def is_due(self, births: int, now_s: float) -> bool:
        """Return whether the epoch ends at a time [s], with so many births."""
        return not self.is_waiting and self._epochs.is_due(births, now_s)

    def depart(
        self, mature: Sequence[Individual], living: int, stay: int
    ) -> tuple[list[Emigrate], list[Individual]]:
        """End the epoch; return what is sent, and who is moved away.

        Args:
            mature: who may leave.
            living: how many live there.
            stay: so many of the mature are not moved away.
        """
        sent, gone = self._epochs.leave(mature, living, len(mature) - stay)
        self._empty += len(gone)
        return sent, gone

    def take(self, event: MigrationEvent) -> None:
        """Keep what came until ``arrive``.

        Raises:
            UnexpectedEvent: it cannot come; nothing has changed.
        """
        self._epochs.take(event)

    def arrive(
        self, living: Sequence[BirthId], births: int, now_s: float
    ) -> list[Individual]:
        """Begin the next epoch; return who came and waits for room now.

        Args:
            living: who is there already, and needs no copy.
            births: in the arena.
            now_s: simulated time [s].
        """
        known = [*living, *(one.birth for one in self.queue)]
        came = [
            replace(one, fitness=0.0, has_failed=False)
            for one, _ in self._epochs.arrive(births, now_s)
            if one.birth not in known
        ]
        self.queue += came
        return came

    def next_in(
        self, mature: Sequence[Individual], *, has_room: bool
    ) -> tuple[Individual, Individual | None] | None:
        """Return who comes in, and who makes room; None if nobody can come in.

        Args:
            mature: who may be replaced.
            has_room: the arena is not full.
        """
        gone = None
        if not self._empty:
            gone = self._epochs.place_for(mature, self.settled)
        if not self.queue or not (gone or has_room):
            return None
        self._empty = max(0, self._empty - 1)
        self.settled += 1
        return self.queue.pop(0), gone
