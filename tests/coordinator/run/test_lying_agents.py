"""Runs beside agents that lie: their answers leave no trace but a count.

Everything but the physics is real: machines, fleet, loop, journal and tables.
"""

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from pathlib import Path

import pytest
from msgspec.structs import replace

from coordinator.dispatch.events import AgentKind, DispatchEvent, Joined, Returned
from coordinator.islands.events import Advanced, JournalledEvent
from coordinator.network.local import LocalAgents
from coordinator.storage.compare import compare
from coordinator.storage.journal import Journal
from schema.agent.request_handler import Compute
from schema.limits import ADVANCE_BYTES, MOST_LIVING
from schema.robot.ids import BirthId
from schema.wire.arena import Advance, Casualty, Judgement
from schema.wire.codec import decode, encode
from schema.wire.messages import Answer, Bred, CallValue, Result
from tests.coordinator.run.test_arena_resume import Run
from tests.coordinator.sent_requests import JUDGED

Lie = Callable[[Answer], Answer | bytes]


def judging(change: Callable[[tuple[Judgement, ...]], tuple[Judgement, ...]]) -> Lie:
    """Return a change of the judgements of each advance."""

    def lie(answer: Answer) -> Answer:
        if not isinstance(answer.result, Advance):
            return answer
        judged = change(answer.result.judgements)
        return replace(answer, result=replace(answer.result, judgements=judged))

    return lie


def saying(result: Result) -> Lie:
    """Return a change of the whole result."""
    return lambda answer: replace(answer, result=result)


DEAD = Casualty(BirthId(0, 0), 1, "x", (0.0, 0.0, 0.0))
ENDLESS = Advance(1, bytes(32), (), (DEAD,) * (MOST_LIVING + 1), ())


def with_liar(kind: AgentKind, lie: Lie) -> type[LocalAgents]:
    """Return agents with one that lies, whose name comes first."""

    class Liars(LocalAgents):
        """Honest agents and one that alters every answer."""

        def __init__(self, agents: Mapping[AgentKind, Compute], platform: str) -> None:
            super().__init__(agents, platform)
            self._agents["a-liar"] = agents[kind]
            self._news.insert(0, Joined("a-liar", kind, 1, platform))

        def receive(
            self, timeout_s: float, pause_s: float = 0.0, /
        ) -> list[DispatchEvent]:
            """Alter the answers of the liar."""
            return list(map(self._altered, super().receive(timeout_s, pause_s)))

        def _altered(self, event: DispatchEvent) -> DispatchEvent:
            if not (isinstance(event, Returned) and event.agent == "a-liar"):
                return event
            told = lie(decode(Answer, event.answer, ADVANCE_BYTES))
            data = told if isinstance(told, bytes) else encode(told)
            return replace(event, answer=data)

    return Liars


def journalled(path: Path) -> list[JournalledEvent]:
    """Return the events of a journal in any order, without durations of answers."""
    with Journal.open(path) as journal:
        events = [
            replace(each, provenance=replace(each.provenance, wall_s=0.0))
            if isinstance(each, Advanced)
            else each
            for each in journal.replay()
        ]
    return sorted(events, key=repr)


LIES: dict[str, tuple[AgentKind, Lie]] = {
    # A journal with such an advance could not be resumed.
    "robot left out": ("worker", judging(lambda judged: judged[1:])),
    "other job": ("worker", lambda answer: replace(answer, number=answer.number + 1)),
    "too many deaths": ("worker", saying(ENDLESS)),
    "30 MB of text": ("worker", saying(CallValue(b"x" * 30_000_000))),
    "no message": ("worker", lambda _: b"\xff"),
    "no child": ("analyzer", saying(Bred(BirthId(0, 0), 0))),
    "evaluation for a child": ("analyzer", saying(JUDGED)),
}


@pytest.mark.parametrize(("kind", "lie"), LIES.values(), ids=LIES)
def test_lies_change_no_table_and_leave_the_journal_alone(
    tmp_path: Path, calm: Path, kind: AgentKind, lie: Lie
) -> None:
    path = tmp_path / "run"
    with ExitStack() as stack:
        one = Run(path, stack, lambda _: None, agents=with_liar(kind, lie))
        turns = 0
        while not one.loop.is_finished:
            one.turn(float(turns))
            turns += 1
        one.rows.finish()
        assert one.fleet.faults.total("malformed") > 0
    assert compare(calm, path) == []
    events = journalled(path)
    assert events == journalled(calm)
    # All that is journalled comes from the honest worker.
    assert {e.provenance.agent for e in events if isinstance(e, Advanced)} == {
        "local-worker"
    }
