"""Events of a journal as fields, and as aligned lines of text."""

from dataclasses import asdict, dataclass
from typing import Any

from coordinator.islands.events import (
    Advanced,
    Audited,
    Commanded,
    Evaluated,
    EvaluationFailed,
    Insert,
    JournalledEvent,
    Order,
    Outcome,
    Pause,
    Remove,
    ReplaceBrain,
    Resume,
    Verdict,
    Vetted,
    VettingFailed,
)
from coordinator.run.requests import requester_of
from schema.robot.ids import BirthId
from schema.robot.results import Provenance
from schema.wire.arena import Casualty, Judgement

_LINE = "{:>6}  {:<17}  {:>6}  {:<8}  {:>3}  {}"
HEADER = _LINE.format("record", "event", "island", "birth", "try", "details")
_DETAILS = {
    "verdict": "{}",
    "reason": "{}",
    "outcomes": "{}",
    "fitness": "fitness {:.4f}",
    "age_s": "age {:.1f} s",
    "simulated_s": "{:.1f} s simulated",
    "motors": "motors {}",
    "mass": "{:.3f} kg",
    "advance": "advance {}",
    "order": "{}",
    "step": "step {}",
    "robots": "robots {}",
    "diverged": "diverged: {}",
    "contacts": "contacts {}",
    "pose_rows": "poses {}",
    "state": "state {:.8}",
    "worker": "worker {}",
    "workers": "workers {}",
    "wall_s": "in {:.3f} s",
}
"""Format of the details of a line, in their order; JSON has more."""

Fields = dict[str, Any]


@dataclass(frozen=True, slots=True)
class Selection:
    """Events to print; None selects all.

    Attributes:
        island: island that handles the event.
        origin: island of a robot's birth.
        birth: number of a robot's birth.
    """

    island: int | None = None
    origin: int | None = None
    birth: int | None = None

    def has(self, island: int, birth: BirthId | None) -> bool:
        """Return whether an event of an island and of a robot, if any, is selected."""
        if self.island not in (None, island):
            return False
        if birth is None:
            return self.birth is None
        is_origin = self.origin in (None, birth.island)
        return is_origin and self.birth in (None, birth.number)


_NAMES: dict[type[JournalledEvent], str] = {
    Vetted: "vetted",
    VettingFailed: "vetting-failed",
    Evaluated: "evaluated",
    EvaluationFailed: "evaluation-failed",
    Advanced: "advanced",
    Commanded: "operator-order",
    Audited: "audited",
}


def describe(event: JournalledEvent, selection: Selection) -> list[Fields]:
    """Return the fields of an event's lines; none if it is not selected.

    An advance has one line, or one for each selected robot in it.
    """
    birth: BirthId | None
    if isinstance(event, Advanced):
        return _advance(event, selection)
    if isinstance(event, Commanded):
        island, birth = event.island, getattr(event.order, "birth", None)
        fields: Fields = {"order": _order(event.order), "step": event.step}
    elif isinstance(event, Audited):
        island, birth = requester_of(event.first), event.first.birth
        fields = _audit(event)
    else:
        island, birth = requester_of(event), event.birth
        fields = _answer(event)
    if not selection.has(island, birth):
        return []
    return [{**_head(event, island, birth), **fields}]


def _head(event: JournalledEvent, island: int, birth: BirthId | None) -> Fields:
    head: Fields = {"event": _NAMES[type(event)], "island": island}
    return head if birth is None else {**head, "birth": _id(birth)}


def _answer(event: Vetted | VettingFailed | Evaluated | EvaluationFailed) -> Fields:
    match event:
        case Vetted(attempt=attempt, report=report):
            reason = {} if report.is_viable else {"reason": report.reason}
            return {
                "attempt": attempt,
                "verdict": "viable" if report.is_viable else "not viable",
                **reason,
                "motors": report.motors,
                "mass": report.mass,
            }
        case VettingFailed():
            return {"attempt": event.attempt, "reason": event.reason}
        case Evaluated():
            outcome = asdict(event.evaluation)
        case EvaluationFailed():
            outcome = {"reason": event.reason}
    return {"trial": event.trial, **outcome, **_worker(event.provenance)}


def _audit(event: Audited) -> Fields:
    both = (event.first, event.second)
    return {
        "verdict": "results agree" if event.agrees else "results differ",
        "outcomes": [
            one.evaluation.fitness if isinstance(one, Evaluated) else one.reason
            for one in both
        ],
        "workers": [one.provenance.agent for one in both],
    }


def _advance(event: Advanced, selection: Selection) -> list[Fields]:
    advance = event.advance
    progress = {"advance": event.number, "step": advance.step}
    if selection.has(event.island, None):
        counts = {
            "diverged": [_id(one.birth) for one in advance.casualties],
            "contacts": len(advance.touches),
            "pose_rows": event.pose_rows,
        }
        return [
            {
                **_head(event, event.island, None),
                **progress,
                "robots": len(advance.judgements),
                **{key: value for key, value in counts.items() if value},
                "state": advance.digest.hex(),
                **_worker(event.provenance),
            }
        ]
    robots: tuple[Judgement | Casualty, ...] = advance.judgements + advance.casualties
    return [
        {**_head(event, event.island, one.birth), **progress, **_robot(one)}
        for one in robots
        if selection.has(event.island, one.birth)
    ]


def _robot(found: Judgement | Casualty) -> Fields:
    if isinstance(found, Casualty):
        return {"verdict": "diverged", "reason": found.reason}
    return {"fitness": found.fitness, "age_s": found.age_s}


def _order(order: Order) -> str:
    match order:
        case Pause():
            return "pause"
        case Resume():
            return "resume"
        case Insert(place=place):
            return f"insert at ({place[0]:g}, {place[1]:g}) m" if place else "insert"
        case Remove():
            return "remove"
        case ReplaceBrain():
            return "replace brain"


def _worker(provenance: Provenance) -> Fields:
    return {
        "worker": provenance.agent,
        "platform": provenance.platform,
        "wall_s": provenance.wall_s,
    }


def _id(birth: BirthId) -> str:
    return f"{birth.island}:{birth.number}"


def line(fields: Fields) -> str:
    """Return the fields of an event as a line of text."""
    details = []
    for key, form in _DETAILS.items():
        value = fields.get(key)
        if isinstance(value, list):
            value = " and ".join(map(str, value))
        if value is not None:
            details.append(form.format(value))
    return _LINE.format(
        fields["record"],
        fields["event"],
        fields["island"],
        fields.get("birth", ""),
        fields.get("attempt", fields.get("trial", "")),
        ", ".join(details).replace("\n", " "),
    )
