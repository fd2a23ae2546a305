"""One island's side of migration: when it sends whom, and for whom it waits.

Epochs are counted on each island by itself. At the end of its epoch e an island
sends every neighbour its migrants, be they none, and goes on when all neighbours
have sent theirs of epoch e, or have finished. So who meets whom does not depend on
who is faster, and nobody can wait for somebody who waits for him.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf

import numpy as np

from coordinator.evolution.random_streams import BufferedRng, Purpose, stream
from coordinator.evolution.selection import Individual, fittest_first
from coordinator.islands.events import (
    Emigrate,
    Immigrated,
    MigrationEvent,
    NeighbourClosed,
)
from schema.errors import UnexpectedEvent
from schema.experiment.migration import Migration, migrant_count
from schema.robot.ids import BirthId


@dataclass(frozen=True, slots=True)
class Neighbours:
    """Where an island lies.

    Attributes:
        targets: islands that it sends migrants to, ascending.
        sources: islands that send it migrants, ascending.
        differing: those of its sources whose judgement does not count here.
    """

    targets: tuple[int, ...]
    sources: tuple[int, ...]
    differing: tuple[int, ...] = ()

    @property
    def neighbours(self) -> tuple[int, ...]:
        """All that it is connected with, one way or both, ascending."""
        return tuple(sorted({*self.targets, *self.sources}))


class MigrationEpochs:
    """What an island sends, and what has come for it.

    Attributes:
        epoch: that it is in, from 0.
        is_waiting: it has sent its migrants, and has not got all of those it is due.
        links: where it lies.
    """

    def __init__(
        self,
        migration: Migration,
        number: int,
        links: Neighbours,
        *,
        tournament_size: int,
        seed: int,
        run: int,
    ) -> None:
        """Begin with the first epoch.

        Args:
            migration: the island's rules.
            number: of the island.
            links: where it lies.
            tournament_size: for emigrants, if they are chosen so.
            seed: of the experiment's execution.
            run: number of the repeat, from 0.
        """
        self.epoch = 0
        self.is_waiting = False
        self.links = links
        self._migration = migration
        self._number = number
        self._tournament_size = tournament_size
        self._seed, self._run = seed, run
        self._due_births = migration.epoch
        self._due_s = inf if migration.epoch_s is None else migration.epoch_s
        self._inbox: dict[tuple[int, int], tuple[Individual, ...]] = {}
        self._open = dict.fromkeys(links.neighbours, 0)
        self._meeting = links.neighbours

    def is_due(self, births: int, now_s: float = -inf) -> bool:
        """Return whether the epoch has ended.

        Args:
            births: on the island.
            now_s: simulated time, in an arena [s].
        """
        return births >= self._due_births or now_s >= self._due_s

    @property
    def has_sources(self) -> bool:
        """Somebody came of late, or sent nobody, and may come again."""
        return any(source in self._meeting for source in self.links.sources)

    @property
    def is_complete(self) -> bool:
        """It has sent, and all that it is due for the epoch is there."""
        return self.is_waiting and all(
            reached > self.epoch for reached in self._open.values()
        )

    def leave(
        self, candidates: Sequence[Individual], living: int, spare: int
    ) -> tuple[list[Emigrate], list[Individual]]:
        """End the epoch: return what is sent, and who is not on the island any more.

        Args:
            candidates: who may leave, in an order that repeats.
            living: how many live there.
            spare: how many may be moved away at most.
        """
        self.is_waiting = True
        targets = [to for to in self.links.targets if to in self._meeting]
        count = migrant_count(self._migration, living)
        is_moved = self._migration.handling == "evict"
        if is_moved:
            count = min(count * len(targets), max(0, spare))
        chosen = self._choose(candidates, min(count, len(candidates)))
        bags = dict.fromkeys(targets, chosen)
        if is_moved:
            # Whoever is dealt to first changes, or a lone migrant knew one way only.
            bags = {
                to: chosen[(place - self.epoch) % len(targets) :: len(targets)]
                for place, to in enumerate(targets)
            }
        sent = [
            Emigrate(self._number, to, self.epoch, tuple(bags.get(to, ())))
            for to in self._meeting
        ]
        return sent, chosen if is_moved and targets else []

    def take(self, event: MigrationEvent) -> None:
        """Keep what came until ``arrive``.

        Raises:
            UnexpectedEvent: it is from no open neighbour, or not the next.
        """
        source = event.source if isinstance(event, Immigrated) else event.neighbour
        expected = self._open.get(source)
        if event.island != self._number or expected is None:
            raise UnexpectedEvent(
                f"island {self._number} has open neighbours {list(self._open)}, "
                f"got {event}"
            )
        if isinstance(event, NeighbourClosed):
            del self._open[source]
            return
        if event.epoch != expected:
            raise UnexpectedEvent(
                f"island {self._number}: epoch {expected} of {source} is next, "
                f"got {event}"
            )
        self._open[source] = expected + 1
        self._inbox[source, event.epoch] = event.migrants

    def arrive(self, births: int, now_s: float = -inf) -> list[tuple[Individual, bool]]:
        """Begin the next epoch: return who came, each once.

        Args:
            births: on the island.
            now_s: simulated time, in an arena [s].

        Returns:
            The immigrants by their source, and whether each must be judged anew.
        """
        met = [one for one in self._meeting if (one, self.epoch) in self._inbox]
        arrivals: dict[BirthId, tuple[Individual, bool]] = {}
        for source in met:
            is_strange = self._migration.judge_anew or source in self.links.differing
            for one in self._inbox.pop((source, self.epoch)):
                arrivals.setdefault(one.birth, (one, is_strange))
        # Not those who are open by now: that would depend on who is faster.
        self._meeting = tuple(met)
        self.epoch += 1
        self.is_waiting = False
        length = self._migration.epoch
        self._due_births = births - births % length + length
        if self._migration.epoch_s is not None:
            self._due_s = now_s + self._migration.epoch_s
        return list(arrivals.values())

    def place_for(
        self, living_robots: Sequence[Individual], arrival: int
    ) -> Individual | None:
        """Return who makes room for an immigrant; None if nobody does.

        Args:
            living_robots: who may be replaced, in an order that repeats.
            arrival: number of the immigrant, of all that came to the island.
        """
        if not living_robots or self._migration.replaced == "none":
            return None
        if self._migration.replaced == "worst":
            return fittest_first(living_robots)[-1]
        name = BirthId(self._number, arrival)
        return BufferedRng(self._stream(name, Purpose.REPLACED)).pick(living_robots)

    def _stream(self, name: BirthId, purpose: Purpose) -> np.random.Generator:
        return stream(self._seed, self._run, name, 0, purpose)

    def _choose(self, candidates: Sequence[Individual], count: int) -> list[Individual]:
        """Return who leaves, the first chosen first."""
        if self._migration.emigrants == "best":
            return fittest_first(candidates)[:count]
        name = BirthId(self._number, self.epoch)
        draws = BufferedRng(self._stream(name, Purpose.EMIGRANTS))
        if self._migration.emigrants == "random":
            return draws.sample(candidates, count)
        chosen: list[Individual] = []
        rest = list(candidates)
        for _ in range(count):
            size = min(self._tournament_size, len(rest))
            chosen.append(fittest_first(draws.sample(rest, size))[0])
            rest.remove(chosen[-1])
        return chosen
