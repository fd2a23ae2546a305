"""Runs beside agents that lie: their answers leave no trace but a count.

Everything but the physics is real: machines, fleet, loop, journal and tables.
"""

from collections.abc import Callable, Mapping
from contextlib import ExitStack
from dataclasses import replace
from pathlib import Path

import pytest
from msgspec import structs

from coordinator.dispatch.events import AgentKind, Joined
from coordinator.islands.events import Advanced, JournalledEvent
from coordinator.network.local import LocalAgents
from coordinator.storage.compare import compare
from coordinator.storage.journal import Journal
from schema.robot.results import Evaluation, Report
from schema.wire import revolve_pb2 as pb
from schema.wire.arena_codec import decode_advance_answer, encode_advance_answer
from schema.wire.codec import decode_answer, encode_answer
from tests.coordinator.run.test_arena_resume import Run, run

Lie = Callable[[bytes], bytes]


def without_a_robot(data: bytes) -> bytes:
    """Leave out a living robot: such a journal could not be resumed."""
    answer = decode_advance_answer(data)
    if answer.advance is None:
        return data
    judged = answer.advance.judgements[1:]
    changed = replace(answer.advance, judgements=judged)
    return encode_advance_answer(replace(answer, advance=changed))


def with_a_stranger(data: bytes) -> bytes:
    message = pb.AdvanceAnswer.FromString(data)
    message.advance.judgements.add(birth=pb.BirthName(number=10_000))
    return message.SerializeToString()


def of_another_job(data: bytes) -> bytes:
    message = pb.AdvanceAnswer.FromString(data)
    message.number += 1
    return message.SerializeToString()


def heavy(data: bytes) -> bytes:
    del data
    message = pb.AdvanceAnswer(advance=pb.Advance(digest=bytes(32)))
    message.advance.casualties.add(reason="x" * 30_000_000)
    return message.SerializeToString()


def false_report(data: bytes) -> bytes:
    answer = decode_answer(data)
    assert isinstance(answer.result, Report)
    return encode_answer(replace(answer, result=replace(answer.result, motors=99)))


def evaluation_for_report(data: bytes) -> bytes:
    wrong = Evaluation(1.0, 0.5, 0.5, 12.0)
    return encode_answer(replace(decode_answer(data), result=wrong))


def with_liar(kind: AgentKind, lie: Lie) -> type[LocalAgents]:
    """Return agents with one that lies, whose name comes first."""

    class Liars(LocalAgents):
        """Honest agents and one that alters every answer."""

        def __init__(
            self, answers: Mapping[AgentKind, Callable[[bytes], bytes]], platform: str
        ) -> None:
            super().__init__(answers, platform)
            honest = answers[kind]
            self._answers["a-liar"] = lambda request: lie(honest(request))
            self._news.insert(0, Joined("a-liar", kind, 1, platform))

    return Liars


def journalled(path: Path) -> list[JournalledEvent]:
    """Return the events of a journal in any order, without durations of answers."""
    with Journal.open(path) as journal:
        events = [
            structs.replace(each, provenance=replace(each.provenance, wall_s=0.0))
            if isinstance(each, Advanced)
            else each
            for each in journal.replay()
        ]
    return sorted(events, key=repr)


@pytest.fixture(scope="module")
def calm(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of an undisturbed run."""
    path = tmp_path_factory.mktemp("calm") / "run"
    assert run(path)
    return path


LIES: dict[str, tuple[AgentKind, Lie]] = {
    "robot left out": ("worker", without_a_robot),
    "unknown robot": ("worker", with_a_stranger),
    "other job": ("worker", of_another_job),
    "30 MB of text": ("worker", heavy),
    "no message": ("worker", lambda _: b"\xff"),
    "false report": ("analyzer", false_report),
    "evaluation for a report": ("analyzer", evaluation_for_report),
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
