"""Events of a journal as fields, and as aligned lines of text."""

import re
from typing import Any

from msgspec import Struct
from msgspec.structs import asdict

from coordinator.islands.events import (
    Advanced,
    Answered,
    Asked,
    Audited,
    Commanded,
    Immigrated,
    Insert,
    JournalledEvent,
    MigrationEvent,
    Order,
    Served,
    source_of,
)
from coordinator.run.requests import requester_of
from schema.robot.ids import BirthId
from schema.robot.results import Provenance
from schema.wire.arena import Casualty, Judgement
from schema.wire.messages import Bred

_LINE = "{:>6}  {:<17}  {:>6}  {:<8}  {:>3}  {}"
HEADER = _LINE.format("record", "event", "island", "birth", "try", "details")
_DETAILS = {
    "verdict": "{}",
    "reason": "{}",
    "outcomes": "{}",
    "request": "request {}",
    "trials": "trials {}",
    "fitness": "fitness {:.4f}",
    "age_s": "age {:.1f} s",
    "simulated_s": "{:.1f} s simulated",
    "parts": "parts {}",
    "failed": "failed: {}",
    "source": "from island {}",
    "epoch": "epoch {}",
    "migrants": "migrants {}",
    "group": "group {}",
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


class EventFilter(Struct, frozen=True):
    """Events to print; None selects all. ``origin`` is the island of the birth."""

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


def describe(event: JournalledEvent, selection: EventFilter) -> list[Fields]:
    """Return the fields of an event's lines; none if it is not selected.

    An advance has one line, or one for each selected robot in it.
    """
    birth: BirthId | None = None
    if isinstance(event, Served):
        fields = {"event": "served", "island": None, "group": event.group}
        return [fields] if selection == EventFilter() else []
    if isinstance(event, Advanced):
        island = event.island
        if not selection.has(island, None):
            return _robots(event, selection)
        fields = _advance(event)
    elif isinstance(event, Commanded):
        island, birth = event.island, getattr(event.order, "birth", None)
        fields = {"order": _order(event.order), "step": event.step}
    elif isinstance(event, Audited):
        island, birth = requester_of(event.first), event.first.birth
        fields = _audit(event)
    elif isinstance(event, MigrationEvent):
        island, fields = event.island, _migration(event)
    else:
        island, birth = requester_of(event), event.birth
        fields = _answer(event)
    is_selected = selection.has(island, birth)
    return [{**_head(event, island, birth), **fields}] if is_selected else []


def _head(event: JournalledEvent, island: int, birth: BirthId | None) -> Fields:
    is_order = isinstance(event, Commanded)
    name = "operator-order" if is_order else _words(event).replace(" ", "-")
    head: Fields = {"event": name, "island": island}
    return head if birth is None else {**head, "birth": birth.name}


def _words(named: object) -> str:
    """Return the name of an object's class as words: "replace brain"."""
    return re.sub("(?<=[a-z])(?=[A-Z])", " ", type(named).__name__).lower()


def _answer(event: Answered) -> Fields:
    if isinstance(event, Asked):
        return {"request": event.number, "trials": len(event.points)}
    if isinstance(event, Bred):
        return _bred(event)
    evaluation = event.evaluation
    outcome = asdict(evaluation) if evaluation else {"reason": event.reason}
    return {"trial": event.trial, **outcome, **_worker(event.provenance)}


def _bred(event: Bred) -> Fields:
    """Return the fields of a birth: its last attempt, and why those before failed."""
    child, failed = event.child, event.attempt + len(event.reasons)
    fields: Fields = {"attempt": failed - (child is None)}
    if child is None:
        fields["verdict"] = "no child"
    else:
        fields |= {"verdict": "viable", "parts": len(child.robot.parts)}
    return {**fields, "failed": [*event.reasons]} if event.reasons else fields


def _migration(event: MigrationEvent) -> Fields:
    fields: Fields = {"source": source_of(event)}
    if isinstance(event, Immigrated):
        migrants = [one.birth.name for one in event.migrants]
        fields |= {"epoch": event.epoch, "migrants": migrants}
    return fields


def _audit(event: Audited) -> Fields:
    both = (event.first, event.second)
    verdict = "both quarantined" if event.is_settled else "results differ"
    return {
        "verdict": "results agree" if event.agrees else verdict,
        "outcomes": [
            one.evaluation.fitness if one.evaluation else one.reason for one in both
        ],
        "workers": [one.provenance.agent for one in both],
    }


def _advance(event: Advanced) -> Fields:
    """Return the fields of an advance; counts of zero are left out."""
    advance = event.advance
    counts = {
        "diverged": [one.birth.name for one in advance.casualties],
        "contacts": len(advance.touches),
        "pose_rows": event.pose_rows,
    }
    return {
        "advance": event.number,
        "step": advance.step,
        "robots": len(advance.judgements),
        **{key: value for key, value in counts.items() if value},
        "state": advance.digest.hex(),
        **_worker(event.provenance),
    }


def _robots(event: Advanced, selection: EventFilter) -> list[Fields]:
    advance = event.advance
    robots: tuple[Judgement | Casualty, ...] = advance.judgements + advance.casualties
    progress = {"advance": event.number, "step": advance.step}
    return [
        {**_head(event, event.island, one.birth), **progress, **_state(one)}
        for one in robots
        if selection.has(event.island, one.birth)
    ]


def _state(robot: Judgement | Casualty) -> Fields:
    if isinstance(robot, Casualty):
        return {"verdict": "diverged", "reason": robot.reason}
    return {"fitness": robot.fitness, "age_s": robot.age_s}


def _order(order: Order) -> str:
    place = order.place if isinstance(order, Insert) else None
    at = f" at ({place[0]:g}, {place[1]:g}) m" if place else ""
    return f"{_words(order)}{at}"


def _worker(provenance: Provenance) -> Fields:
    """Return the fields of a provenance; the agent is a worker."""
    fields = asdict(provenance)
    return {"worker": fields.pop("agent"), **fields}


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
        "" if fields["island"] is None else fields["island"],
        fields.get("birth", ""),
        fields.get("attempt", fields.get("trial", "")),
        ", ".join(details).replace("\n", " "),
    )
