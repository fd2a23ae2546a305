"""Candidates of an arena that are being bred or await insertion."""

from collections import deque
from collections.abc import Sequence

from msgspec import Struct

from coordinator.evolution.breeding import Breeder, Candidate, Couple, Individual
from schema.errors import UnexpectedEvent
from schema.experiment.document import Experiment
from schema.plugins.arena_rules import Conception
from schema.robot.ids import BirthId
from schema.wire.messages import Bred, Breed


class Mating(Struct, frozen=True):
    """Child that the rules of an arena want.

    Attributes:
        wish: what they say of it.
        parents: those that they name; else all that may be selected.
    """

    wish: Conception
    parents: tuple[Individual, ...]

    @property
    def parents_are_named(self) -> bool:
        """Its parents are not selected."""
        return bool(self.wish.parents)


class BreedingQueue:
    """Founders and children until their bodies are viable and they are inserted.

    The children of one decision follow one another, as each needs a birth number.

    A birth number is used once a candidate is viable. Failed attempts at a number are
    counted on at the next birth, so that each attempt has its own stream.
    """

    def __init__(self, experiment: Experiment, breeder: Breeder, island: int) -> None:
        self._breeder = breeder
        self._island = island
        self._viable: dict[int, Candidate] = {}
        self._in_breeding: dict[int, tuple[Breed, Couple | None]] = {}
        self._children: list[tuple[Mating, Candidate | None, str]] = []
        self._excess: Sequence[Mating] = ()
        self._matings: deque[Mating] = deque()
        self._mating: Mating | None = None
        self._next = experiment.selection.population
        self._failed = 0

    @property
    def is_busy(self) -> bool:
        """A child or a founder is awaited."""
        return bool(self._in_breeding)

    def begin_founders(self) -> list[Breed]:
        """Return the requests for the founders."""
        return [self._begin(number, 0) for number in range(self._next)]

    def begin_children(self, matings: Sequence[Mating], room: int) -> list[Breed]:
        """Mate one couple after the other; return the first request, if any.

        Those beyond ``room`` have no child.
        """
        self._matings.extend(matings[:room])
        self._excess = matings[room:]
        return self._next_child()

    def _next_child(self) -> list[Breed]:
        if not self._matings:
            return []
        self._mating = self._matings.popleft()
        return [self._begin(self._next, self._failed)]

    def take_viable(self) -> list[Candidate]:
        """Return the viable founders by birth id, and remove them."""
        viable, self._viable = self._viable, {}
        return [viable[number] for number in sorted(viable)]

    def take_children(self) -> list[tuple[Mating, Candidate | None, str]]:
        """Return the matings since the last call, each with child and outcome."""
        children, self._children = self._children, []
        excess, self._excess = self._excess, ()
        return [*children, *((mating, None, "no room") for mating in excess)]

    def take_number(self) -> BirthId:
        """Return the next birth id, for a robot that is not bred."""
        self._next, self._failed = self._next + 1, 0
        return BirthId(self._island, self._next - 1)

    def has_taken(self, birth: BirthId) -> bool:
        """Return whether the number of a birth is used."""
        return 0 <= birth.number < self._next

    def take(self, event: Bred) -> list[Breed]:
        """Handle the outcome of breeding; return the request that follows, if any.

        Raises:
            UnexpectedEvent: the outcome of what was never requested.
        """
        number = event.birth.number
        request, couple = self._in_breeding.get(number, (None, None))
        if event.birth.island != self._island or self._is_new(event, request):
            raise UnexpectedEvent(
                f"island {self._island}, births 0..{self._next - 1} are taken, "
                f"{self._failed} attempts at the next failed, breeding "
                f"{sorted(self._in_breeding)}: never requested, got {event}"
            )
        if request is None or event.attempt < request.attempt:
            return []
        del self._in_breeding[number]
        candidate = self._breeder.candidate(event, couple)
        if number < self._next:
            if candidate is None:
                return [self._begin(number, request.end, event.why)]
            self._viable[number] = candidate
            return []
        if candidate is None:
            self._failed = request.end
        else:
            self.take_number()
        assert self._mating is not None
        outcome = "not viable" if candidate is None else "born"
        self._children.append((self._mating, candidate, outcome))
        return self._next_child()

    def _is_new(self, event: Bred, request: Breed | None) -> bool:
        """Return whether an answer belongs to no request so far."""
        number = event.birth.number
        if request is not None:
            return event.attempt > request.attempt
        if number == self._next:
            return event.attempt >= self._failed
        return not 0 <= number < self._next

    def _begin(self, number: int, attempt: int, why: str = "") -> Breed:
        """Return the request for a founder, or for the child of the current mating."""
        birth = BirthId(self._island, number)
        mating = None if number < self._next else self._mating
        begun = self._breeder.request(
            birth,
            attempt,
            mating.parents if mating else (),
            why,
            is_chosen=mating is not None and mating.parents_are_named,
        )
        self._in_breeding[number] = begun
        return begun[0]
