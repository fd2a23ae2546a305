"""Candidates of an arena that await vetting or insertion."""

from collections.abc import Sequence
from math import inf

from coordinator.evolution.breeding import Breeder, Candidate, Couple, Individual
from coordinator.islands.events import Verdict, Vetted
from schema.errors import UnexpectedEvent
from schema.experiment.document import Experiment
from schema.robot.ids import BirthId
from schema.wire.messages import Vet


class VettingQueue:
    """Founders and children until their bodies are viable and they are inserted.

    A birth number is used once a candidate is viable. Failed attempts at a number are
    counted on at the next birth, so that each attempt has its own stream.
    """

    def __init__(self, experiment: Experiment, breeder: Breeder, island: int) -> None:
        self._breeder = breeder
        self._island = island
        self._attempts = experiment.selection.max_mating_attempts
        self._viable: dict[int, Candidate] = {}
        self._in_vetting: dict[int, Candidate] = {}
        self._mature: tuple[Individual, ...] = ()
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

    def begin_child(self, mature: Sequence[Individual]) -> list[Vet]:
        """Mate two of the mature; return the vetting, if there is a candidate."""
        self._mature = tuple(mature)
        self._end = self._failed + self._attempts
        return self._try(self._next, self._failed)

    def take_viable(self) -> list[Candidate]:
        """Return the viable candidates by birth id, and remove them."""
        viable, self._viable = self._viable, {}
        return [viable[number] for number in sorted(viable)]

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
            self._viable[number] = candidate
            if number == self._next:
                self.take_number()
            return []
        why = event.report.reason if isinstance(event, Vetted) else event.reason
        return self._try(number, candidate.attempt + 1, candidate.couple, why)

    def _is_new(self, event: Verdict, candidate: Candidate | None) -> bool:
        """Return whether an answer belongs to no request so far."""
        number = event.birth.number
        if candidate is not None:
            return event.attempt > candidate.attempt
        if number == self._next:
            return event.attempt >= self._failed
        return not 0 <= number < self._next

    def _try(
        self, number: int, attempt: int, couple: Couple | None = None, why: str = ""
    ) -> list[Vet]:
        """Return the vetting of the first candidate from an attempt on, if any."""
        birth = BirthId(self._island, number)
        is_founder = number < self._next
        parents, end = ((), inf) if is_founder else (self._mature, self._end)
        candidate = self._breeder.candidate(
            birth, attempt, parents, couple, why, end=end
        )
        if candidate is None:
            self._failed = self._end
            return []
        self._in_vetting[number] = candidate
        return [Vet(birth, candidate.attempt, candidate.robot)]
