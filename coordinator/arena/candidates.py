"""An arena's unborn: candidates whose bodies the analyzer is asked about."""

from collections.abc import Sequence

from coordinator.evolution.breeding import BARREN, Breeder, Candidate
from coordinator.evolution.selection import Couple, Individual
from coordinator.islands.events import Vet, Vetted, VettingFailed
from schema.errors import UnexpectedEvent
from schema.robot.ids import BirthId


class VettingQueue:
    """Brings founders and children to the point where they can be inserted.

    A number is used when somebody is viable under it. Attempts that came to none go
    on being counted at the next slot, so that no two of them draw alike.

    Attributes:
        viable: who can be inserted, by number; the arena takes them out.
    """

    def __init__(self, breeder: Breeder, island: int, attempts: int) -> None:
        """Begin with nobody; a couple has so many attempts at a child."""
        self.viable: dict[int, Candidate] = {}
        self._breeder = breeder
        self._island = island
        self._attempts = attempts
        self._asked: dict[int, Candidate] = {}
        self._mature: tuple[Individual, ...] = ()
        self._next = 0
        self._failed = 0
        self._end = 0

    @property
    def is_busy(self) -> bool:
        """A verdict is awaited."""
        return bool(self._asked)

    def found(self, count: int) -> list[Vet]:
        """Make founders, as often as it takes; return what to ask."""
        self._next = count
        vets: list[Vet] = []
        for number in range(count):
            vets += self._try(number, 0, None, "")
        return vets

    def mate(self, mature: Sequence[Individual]) -> list[Vet]:
        """Let two of the mature try for a child; return what to ask, if anything."""
        self._mature = tuple(mature)
        self._end = self._failed + self._attempts
        return self._try(self._next, self._failed, None, "")

    def take_number(self) -> BirthId:
        """Return a name for somebody who was not conceived here."""
        self._next, self._failed = self._next + 1, 0
        return BirthId(self._island, self._next - 1)

    def judge(self, event: Vetted | VettingFailed) -> list[Vet]:
        """Take a verdict; return what to ask next, if anything.

        Raises:
            UnexpectedEvent: a verdict on what was never asked.
        """
        number = event.birth.number
        candidate = self._asked.get(number)
        if event.birth.island != self._island or self._is_new(event, candidate):
            raise UnexpectedEvent(
                f"island {self._island}, births 0..{self._next - 1} are taken, "
                f"{self._failed} attempts at the next failed, asked about "
                f"{sorted(self._asked)}: never asked, got {event}"
            )
        if candidate is None or event.attempt < candidate.attempt:
            return []
        del self._asked[number]
        if isinstance(event, Vetted) and event.report.is_viable:
            self.viable[number] = candidate
            if number == self._next:
                self.take_number()
            return []
        why = event.report.reason if isinstance(event, Vetted) else event.reason
        return self._try(number, candidate.attempt + 1, candidate.couple, why)

    def _is_new(
        self, event: Vetted | VettingFailed, candidate: Candidate | None
    ) -> bool:
        """Return whether an answer is to a question of the future."""
        number = event.birth.number
        if candidate is not None:
            return event.attempt > candidate.attempt
        if number == self._next:
            return event.attempt >= self._failed
        return not 0 <= number < self._next

    def _try(
        self, number: int, attempt: int, couple: Couple | None, why: str
    ) -> list[Vet]:
        """Ask about the first candidate from an attempt on; or give up."""
        birth = BirthId(self._island, number)
        is_founder = number < self._next
        mature = () if is_founder else self._mature
        while is_founder or attempt < self._end:
            couple, candidate = self._breeder.attempt(
                birth, attempt, mature, couple, why
            )
            if candidate is not None:
                self._asked[number] = candidate
                return [Vet(birth, attempt, candidate.robot)]
            attempt += 1
            why = BARREN
        self._failed = attempt
        return []
