"""Candidates of an arena that await vetting or insertion."""

from collections import deque
from collections.abc import Sequence
from math import inf

from msgspec import Struct

from coordinator.evolution.breeding import Breeder, Candidate, Couple, Individual
from coordinator.islands.events import Verdict, Vetted
from schema.errors import UnexpectedEvent
from schema.experiment.document import Experiment
from schema.plugins.arena_rules import Conception
from schema.robot.ids import BirthId
from schema.wire.messages import Vet


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


class VettingQueue:
    """Founders and children until their bodies are viable and they are inserted.

    The children of one decision follow one another, as each needs a birth number.

    A birth number is used once a candidate is viable. Failed attempts at a number are
    counted on at the next birth, so that each attempt has its own stream.
    """

    def __init__(self, experiment: Experiment, breeder: Breeder, island: int) -> None:
        self._breeder = breeder
        self._island = island
        self._attempts = experiment.selection.max_mating_attempts
        self._viable: dict[int, Candidate] = {}
        self._in_vetting: dict[int, Candidate] = {}
        self._children: list[tuple[Mating, Candidate | None, str]] = []
        self._excess: Sequence[Mating] = ()
        self._matings: deque[Mating] = deque()
        self._mating: Mating | None = None
        self._next = experiment.selection.population
        self._failed = 0
        self._end = 0

    @property
    def is_busy(self) -> bool:
        """A report is awaited."""
        return bool(self._in_vetting)

    def begin_founders(self) -> list[Vet]:
        """Generate the founders; return their vettings."""
        return [vet for number in range(self._next) for vet in self._try(number, 0)]

    def begin_children(self, matings: Sequence[Mating], room: int) -> list[Vet]:
        """Mate one couple after the other; return the first vetting, if any.

        Those beyond ``room`` have no child.
        """
        self._matings.extend(matings[:room])
        self._excess = matings[room:]
        return self._next_child()

    def _next_child(self) -> list[Vet]:
        vets: list[Vet] = []
        while self._matings and not vets:
            self._mating = self._matings.popleft()
            self._end = self._failed + self._attempts
            vets = self._try(self._next, self._failed)
        return vets

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
        """Return the next birth id, for a robot that needs no vetting."""
        self._next, self._failed = self._next + 1, 0
        return BirthId(self._island, self._next - 1)

    def has_taken(self, birth: BirthId) -> bool:
        """Return whether the number of a birth is used."""
        return 0 <= birth.number < self._next

    def take(self, event: Verdict) -> list[Vet]:
        """Handle a report; return the vetting of the next attempt, if there is one.

        Raises:
            UnexpectedEvent: a report on a vetting that was never requested.
        """
        number = event.birth.number
        candidate = self._in_vetting.get(number)
        if event.birth.island != self._island or self._is_new(event, candidate):
            raise UnexpectedEvent(
                f"island {self._island}, births 0..{self._next - 1} are taken, "
                f"{self._failed} attempts at the next failed, vetting "
                f"{sorted(self._in_vetting)}: never requested, got {event}"
            )
        if candidate is None or event.attempt < candidate.attempt:
            return []
        del self._in_vetting[number]
        if isinstance(event, Vetted) and event.report.is_viable:
            if number < self._next:
                self._viable[number] = candidate
                return []
            self.take_number()
            self._end_mating(candidate)
            return self._next_child()
        why = event.report.reason if isinstance(event, Vetted) else event.reason
        vets = self._try(number, candidate.attempt + 1, candidate.couple, why)
        return vets or self._next_child()

    def _is_new(self, event: Verdict, candidate: Candidate | None) -> bool:
        """Return whether an answer belongs to no request so far."""
        number = event.birth.number
        if candidate is not None:
            return event.attempt > candidate.attempt
        if number == self._next:
            return event.attempt >= self._failed
        return not 0 <= number < self._next

    def _end_mating(self, child: Candidate | None) -> None:
        assert self._mating is not None
        outcome = "not viable" if child is None else "born"
        self._children.append((self._mating, child, outcome))

    def _try(
        self, number: int, attempt: int, couple: Couple | None = None, why: str = ""
    ) -> list[Vet]:
        """Return the vetting of the first candidate from an attempt on, if any."""
        birth = BirthId(self._island, number)
        mating = None if number < self._next else self._mating
        candidate = self._breeder.candidate(
            birth,
            attempt,
            mating.parents if mating else (),
            couple,
            why,
            end=self._end if mating else inf,
            is_chosen=mating is not None and mating.parents_are_named,
        )
        if candidate is None:
            self._failed = self._end
            self._end_mating(None)
            return []
        self._in_vetting[number] = candidate
        return [Vet(birth, candidate.attempt, candidate.robot)]
