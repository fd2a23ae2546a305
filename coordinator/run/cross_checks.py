"""Cross-checks: evaluations that two workers do, to compare the results; and breeding.

The birth decides whether an evaluation is checked, so that a resumed run checks the
same ones. A check changes no birth: equal answers count as one, and different answers
stop the run, as it is unknown which of them is right. What an analyzer breeds is bred
again in this process; another answer is refused.
"""

from dataclasses import dataclass
from hashlib import sha256

from coordinator.islands.events import Answered, Audited, Outcome, Record
from coordinator.islands.rows import outcome_columns
from schema.agent.request_handler import Compute
from schema.robot.ids import BirthId

_WHOLE = 2**32


@dataclass(frozen=True, slots=True)
class Checks:
    """Checks that a user wants; none of them changes a birth.

    Attributes:
        audit: share of evaluations that two workers do, and of children that are bred
            twice.
        pauses: the run stops when a robot is quarantined, until it is resumed.
        breed: answers a request to breed in this process, to compare.
    """

    audit: float = 0.0
    pauses: bool = False
    breed: Compute | None = None

    def chooses(self, birth: BirthId, number: int) -> bool:
        """Return whether a trial or an attempt at a birth is checked."""
        if not self.audit:
            return False
        name = f"{birth.island}/{birth.number}/{number}"
        digest = sha256(name.encode()).digest()
        return int.from_bytes(digest[:4]) < self.audit * _WHOLE


NO_CHECKS = Checks()
"""No audits, and no pause."""


class CrossChecks:
    """Evaluations of a run that are done twice."""

    def __init__(self) -> None:
        self._others: dict[int, int] = {}
        self._outcomes: dict[int, Outcome] = {}

    def pair(self, first: int, second: int) -> None:
        """Note the numbers of two jobs that are the same evaluation."""
        self._others[first], self._others[second] = second, first

    def settle(self, number: int, outcome: Answered) -> list[Answered | Audited]:
        """Return the events that follow from the outcome of a job.

        Returns:
            The outcome, if the job is not one of a pair; for a pair nothing at the
            first, and at the second the check and, if it is settled, the outcome.
        """
        if not isinstance(outcome, Outcome):
            return [outcome]
        other = self._others.pop(number, None)
        if other is None:
            return [outcome]
        if other in self._others:
            self._outcomes[number] = outcome
            return []
        found = {number: outcome, other: self._outcomes.pop(other)}
        first, second = (found[each] for each in sorted(found))
        audited = Audited(first, second)
        return [audited, first] if audited.is_settled else [audited]


def describe(event: Audited) -> str:
    """Describe which workers disagree on which evaluation."""
    outcomes = []
    for each in (event.first, event.second):
        found, source = each.evaluation, each.provenance
        result = f"fitness {found.fitness!r}" if found else repr(each.reason)
        outcomes.append(f"{source.agent} ({source.platform or 'gone'}) says {result}")
    birth = event.first.birth
    return (
        f"birth {birth.number} of island {birth.island}: {', '.join(outcomes)}; "
        "both are in the table 'audits'; remove one of these machines and resume"
    )


def audit_records(event: Audited) -> list[Record]:
    """Return the two rows of an audit."""
    return [
        Record(
            "audits",
            {
                "island": each.birth.island,
                "birth": each.birth.number,
                "trial": each.trial,
                "agrees": event.agrees,
                "worker": each.provenance.agent,
                "platform": each.provenance.platform,
                **outcome_columns(each),
            },
        )
        for each in (event.first, event.second)
    ]
