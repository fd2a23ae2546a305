"""Migration epochs of one island: which migrants it sends, and which it awaits.

Each island counts its own epochs. At the end of epoch e an island sends its migrants,
possibly none, to every neighbour, and continues when all neighbours have sent theirs
of epoch e or have finished. So the outcome does not depend on the speed of the
islands, and no two islands can wait for each other.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import partial
from math import inf

from coordinator.evolution.breeding import Individual
from coordinator.evolution.random_streams import BufferedRng, Purpose, stream
from coordinator.evolution.rules import Rule
from coordinator.evolution.selection import fittest_first
from coordinator.islands.events import (
    Emigrate,
    Immigrated,
    MigrationEvent,
    NeighbourClosed,
    source_of,
)
from schema.errors import UnexpectedEvent
from schema.experiment.document import Experiment
from schema.experiment.migration import migrant_count
from schema.robot.ids import BirthId


@dataclass(frozen=True, slots=True)
class Neighbours:
    """Neighbours of an island.

    Attributes:
        targets: islands that it sends migrants to, ascending.
        sources: islands that send it migrants, ascending.
        differing: sources with another evaluation; their migrants are re-evaluated.
    """

    targets: tuple[int, ...]
    sources: tuple[int, ...]
    differing: tuple[int, ...] = ()

    @property
    def neighbours(self) -> tuple[int, ...]:
        """All islands that it is connected with, one way or both, ascending."""
        return tuple(sorted({*self.targets, *self.sources}))


class MigrationEpochs:
    """Epochs of one island: its emigrants, and immigrants that have arrived.

    Attributes:
        epoch: number of the epoch, from 0.
        is_waiting: it has sent its migrants and awaits those of its neighbours.
        emigrants: own rule that selects them, which its island makes, if any.
        next_epochs: epoch whose migrants come next, of each open neighbour.
    """

    def __init__(
        self,
        experiment: Experiment,
        number: int,
        links: Neighbours,
        seed: int,
        run: int,
    ) -> None:
        """Initialise the first epoch; arguments as in ``Island``."""
        self.island = number
        self.links = links
        self.epoch = 0
        self.is_waiting = False
        self.emigrants: Rule | None = None
        assert experiment.migration is not None
        self._migration = migration = experiment.migration
        self._tournament_size = experiment.selection.tournament_size
        self._stream = partial(stream, seed, run)
        self._due_births = migration.epoch
        self._due_s = inf if migration.epoch_s is None else migration.epoch_s
        self._inbox: dict[tuple[int, int], Immigrated] = {}
        self.next_epochs = dict.fromkeys(links.neighbours, 0)
        self._active = links.neighbours
        self._follows_closing = False

    def is_due(self, births: int, now_s: float = -inf) -> bool:
        """Return whether the epoch ends now; arenas give their simulated time [s]."""
        return births >= self._due_births or now_s >= self._due_s

    @property
    def has_sources(self) -> bool:
        """A source took part in the last epoch, and may send migrants again."""
        return any(source in self._active for source in self.links.sources)

    @property
    def is_complete(self) -> bool:
        """It is waiting, and all open neighbours have sent their migrants."""
        return self.is_waiting and not self.missing

    @property
    def missing(self) -> list[int]:
        """Neighbours whose migrants of this epoch have not arrived."""
        following = self.next_epochs.items()
        return [each for each, epoch in following if epoch <= self.epoch]

    def send(
        self, candidates: Sequence[Individual], living: int, spare: int
    ) -> tuple[list[Emigrate], list[Individual]]:
        """End the epoch; return the commands, and the individuals that were moved.

        The candidates are in a reproducible order; at most ``spare`` of them may be
        moved away.
        """
        self.is_waiting = True
        targets = [to for to in self.links.targets if to in self._active]
        count = migrant_count(self._migration, living)
        is_moved = self._migration.handling == "evict"
        if is_moved:
            count = min(count * len(targets), max(0, spare))
        chosen = self._choose(candidates, min(count, len(candidates)))
        # Each target gets all that are copied, or a share of those that are moved. The
        # first target changes, or a single migrant would always go there.
        step = len(targets) if is_moved else 1
        shares = {
            to: chosen[(place - self.epoch) % step :: step]
            for place, to in enumerate(targets)
        }
        sent = [
            Emigrate(
                self.island,
                to,
                self.epoch,
                tuple(shares.get(to, ())),
                self._follows_closing,
            )
            for to in self._active
        ]
        return sent, chosen if is_moved and targets else []

    def take(self, event: MigrationEvent) -> None:
        """Store an event until ``receive``.

        Raises:
            UnexpectedEvent: it comes from no open neighbour, or not in order.
        """
        source = source_of(event)
        expected = self.next_epochs.get(source)
        if event.island != self.island or expected is None:
            raise UnexpectedEvent(
                f"island {self.island} has open neighbours {list(self.next_epochs)}, "
                f"got {event}"
            )
        if isinstance(event, NeighbourClosed):
            del self.next_epochs[source]
            return
        if event.epoch != expected:
            raise UnexpectedEvent(
                f"island {self.island}: epoch {expected} of {source} is next, "
                f"got {event}"
            )
        self.next_epochs[source] = expected + 1
        self._inbox[source, event.epoch] = event

    def receive(
        self, known: Collection[BirthId], births: int, now_s: float = -inf
    ) -> list[tuple[Individual, bool]]:
        """Begin the next epoch; return the immigrants of the last one, each once.

        They are by source, and with each is whether it must be re-evaluated. Those that
        are ``known`` are left out; arenas give their simulated time [s].
        """
        senders = [one for one in self._active if (one, self.epoch) in self._inbox]
        arrivals: dict[BirthId, tuple[Individual, bool]] = {}
        for source in senders:
            is_reevaluated = (
                self._migration.judge_anew or source in self.links.differing
            )
            event = self._inbox.pop((source, self.epoch))
            self._follows_closing |= event.follows_closing
            for one in event.migrants:
                if one.birth not in known:
                    arrivals.setdefault(one.birth, (one, is_reevaluated))
        # Not the neighbours that are open now: that would depend on their speed.
        self._follows_closing |= len(senders) < len(self._active)
        self._active = tuple(senders)
        self.epoch += 1
        self.is_waiting = False
        length = self._migration.epoch
        self._due_births = births - births % length + length
        if self._migration.epoch_s is not None:
            self._due_s = now_s + self._migration.epoch_s
        return list(arrivals.values())

    def choose_replaced(
        self, candidates: Sequence[Individual], arrival: int
    ) -> Individual | None:
        """Return the individual that an immigrant replaces; None if it replaces none.

        The candidates are in a reproducible order; ``arrival`` counts the immigrants
        that settled on the island before.
        """
        if not candidates or self._migration.replaced == "none":
            return None
        if self._migration.replaced == "worst":
            return fittest_first(candidates)[-1]
        return self._draws(arrival, Purpose.REPLACED).pick(candidates)

    def _draws(self, number: int, purpose: Purpose) -> BufferedRng:
        name = BirthId(self.island, number)
        return BufferedRng(self._stream(name, 0, purpose))

    def _choose(self, candidates: Sequence[Individual], count: int) -> list[Individual]:
        """Return the emigrants in the order of choice."""
        if self.emigrants is not None and count:
            name = BirthId(self.island, self.epoch)
            rng = self._stream(name, 0, Purpose.EMIGRANTS)
            places = self.emigrants.places(count, candidates, rng)
            return [candidates[at] for at in places]
        if self._migration.emigrants == "best":
            return fittest_first(candidates)[:count]
        draws = self._draws(self.epoch, Purpose.EMIGRANTS)
        if self._migration.emigrants == "random":
            return draws.sample(candidates, count)
        chosen: list[Individual] = []
        rest = list(candidates)
        for _ in range(count):
            size = min(self._tournament_size, len(rest))
            chosen.append(fittest_first(draws.sample(rest, size))[0])
            rest.remove(chosen[-1])
        return chosen
