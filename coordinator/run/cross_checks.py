"""Evaluations that are done twice, by two workers, to see whether they agree. Pure.

Which ones is a matter of who is evaluated, so that a resumed run audits the same.
An audit changes no birth: equal answers are one answer, and unequal ones stop the
run, for nobody here knows which of them is right.
"""

from dataclasses import dataclass
from hashlib import sha256

from coordinator.islands.events import (
    Answered,
    Audited,
    Evaluate,
    Evaluated,
    EvaluationFailed,
    Record,
)

_WHOLE = 2**32


@dataclass(frozen=True, slots=True)
class Checks:
    """What a user wants to be careful about; none of it changes a birth.

    Attributes:
        audit: share of evaluations that two workers do.
        pauses: the run stops when a robot is quarantined, until it is resumed.
    """

    audit: float = 0.0
    pauses: bool = False


NO_CHECKS = Checks()
"""No audits, and no pause."""


class CrossChecks:
    """The evaluations of a run that are done twice."""

    def __init__(self, share: float) -> None:
        """Choose a share of them.

        Args:
            share: from 0, none, to 1, all.
        """
        self._share = share
        self._others: dict[int, int] = {}
        self._outcomes: dict[int, Evaluated | EvaluationFailed] = {}

    def chooses(self, command: Evaluate) -> bool:
        """Return whether an evaluation is to be done twice."""
        birth = command.birth
        name = f"{birth.island}/{birth.number}/{command.trial}"
        digest = sha256(name.encode()).digest()
        return int.from_bytes(digest[:4]) < self._share * _WHOLE

    def pair(self, first: int, second: int) -> None:
        """Note the numbers of two jobs that are the same question."""
        self._others[first], self._others[second] = second, first

    def settle(self, number: int, outcome: Answered) -> list[Answered | Audited]:
        """Return what a job's outcome comes to, now that it is known.

        Args:
            number: of the job.
            outcome: its own.

        Returns:
            The outcome, if nobody else was asked; of a pair nothing at the first one,
            and at the second what was found and, if they agree, the outcome.
        """
        if not isinstance(outcome, Evaluated | EvaluationFailed):
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
        return [audited, first] if audited.agrees else [audited]


def describe(event: Audited) -> str:
    """Return, in a line, between whom there is no agreement about what."""
    told = [
        f"{each.provenance.agent} ({each.provenance.platform or 'gone'}) says "
        + (
            f"fitness {each.evaluation.fitness!r}"
            if isinstance(each, Evaluated)
            else repr(each.reason)
        )
        for each in (event.first, event.second)
    ]
    birth = event.first.birth
    return (
        f"birth {birth.number} of island {birth.island}: {', '.join(told)}; both are "
        "in the table 'audits'; take one of these machines away and resume"
    )


def audit_records(event: Audited) -> list[Record]:
    """Return the two rows of an audit."""
    return [_row(event, each) for each in (event.first, event.second)]


def _row(event: Audited, outcome: Evaluated | EvaluationFailed) -> Record:
    judged = outcome.evaluation if isinstance(outcome, Evaluated) else None
    row = {
        "island": outcome.birth.island,
        "birth": outcome.birth.number,
        "trial": outcome.trial,
        "agrees": event.agrees,
        "worker": outcome.provenance.agent,
        "platform": outcome.provenance.platform,
        "reason": "" if isinstance(outcome, Evaluated) else outcome.reason,
        "fitness": judged and judged.fitness,
        "path_velocity": judged and judged.path_velocity,
        "straight_velocity": judged and judged.straight_velocity,
        "simulated_s": judged and judged.simulated_s,
    }
    return Record("audits", row)
