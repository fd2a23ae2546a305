"""Answers about arenas that contradict their requests or the arena's state."""

import math
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from hashlib import sha256
from typing import Any

import numpy as np
import pyarrow as pa
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.strategies import DataObject

from coordinator.dispatch.events import (
    Client,
    DispatchEvent,
    Joined,
    Returned,
    ShardDone,
)
from coordinator.dispatch.fleet import End, Fleet
from coordinator.islands.events import Advanced
from coordinator.run.run_context import RunContext
from coordinator.run.shard_requests import Reached, ShardRequests
from schema.errors import MalformedMessage
from schema.experiment.identity import Origin
from schema.robot.ids import BirthId
from schema.tables.columns import POSES
from schema.tables.received import read_columns
from schema.wire import revolve_pb2 as pb
from schema.wire.arena import (
    Advance,
    AdvanceShard,
    Casualty,
    Changes,
    Insertion,
    Judgement,
    Touch,
)
from schema.wire.arena_codec import (
    AdvanceAnswer,
    decode_advance_answer,
    decode_advance_request,
    encode_advance_answer,
)
from tests.coordinator.arena_world import DT, experiment
from tests.coordinator.sent_requests import ROBOT
from tests.worker.fake_world import FakeWorld
from worker.serve.shards import Shards

CLIENT = Client("run", 3)
FIRST, SECOND, THIRD = (BirthId(0, number) for number in range(3))
STRANGER = BirthId(0, 9)
UNTIL, NEXT = 1000, 2000

AnswerChange = Callable[[AdvanceAnswer], AdvanceAnswer]


class NoDeaths(FakeWorld):
    """World in which all robots live on."""

    def _chance(self, birth: BirthId) -> float:
        return max(0.02, super()._chance(birth))


class Kept:
    """Snapshots in memory."""

    def __init__(self) -> None:
        self.data: dict[tuple[int, int], bytes] = {}

    def has(self, shard: int, step: int, digest: bytes) -> bool:
        data = self.data.get((shard, step))
        return data is not None and sha256(data).digest() == digest

    def write(self, shard: int, step: int, data: bytes) -> None:
        self.data[shard, step] = data

    def read(self, shard: int, step: int) -> bytes:
        return self.data[shard, step]

    def drop_before(self, shard: int, step: int) -> None:
        del shard, step


class Two:
    """An arena and two workers; the test answers for them.

    After its first advance three robots live: one was removed, one inserted.
    """

    def __init__(self, *, has_touches: bool = False) -> None:
        self.sent: list[tuple[int, str, bytes]] = []
        self.now_s = 0.0
        self.fleet = Fleet(self)
        rules = experiment(9, record_touches=has_touches)
        context = RunContext.of("run", 3, rules, Origin())
        self.requests = ShardRequests(context, Kept(), self.fleet)
        self.shards = {name: Shards(NoDeaths) for name in ("one", "two")}
        for name in self.shards:
            self.fleet.tell(Joined(name, "worker", 1, "any"))
        founders = tuple(Insertion(each, ROBOT, (0.0, 0.0)) for each in (FIRST, SECOND))
        self.requests.send(AdvanceShard(0, 0, UNTIL, Changes((), founders), False))
        (end,) = self.answer(self.true_answer())
        self.requests.commit(event_of(end))
        changes = Changes((FIRST,), (Insertion(THIRD, ROBOT, (1.0, 0.0)),))
        self.requests.send(AdvanceShard(0, 1, NEXT, changes, True))

    def send(self, number: int, agent: str, payload: bytes, _wait_s: float, /) -> None:
        self.sent.append((number, agent, payload))

    def cancel(self, _agent: str, _payload: bytes, /) -> None:
        raise NotImplementedError

    def ask(self, _agent: str) -> None:
        """No agent reports progress."""

    def receive(
        self, _timeout_s: float, _pause_s: float = 0.0, /
    ) -> list[DispatchEvent]:
        return []

    def true_answer(self) -> AdvanceAnswer:
        """Return the answer of an honest worker to the newest request."""
        _, agent, payload = self.sent[-1]
        return decode_advance_answer(self.shards[agent].answer(payload))

    def answer(self, answer: AdvanceAnswer | bytes) -> list[End]:
        """Answer the newest request; return what ended."""
        if isinstance(answer, AdvanceAnswer):
            answer = encode_advance_answer(answer)
        number, agent, _ = self.sent[-1]
        self.fleet.tell(Returned(number, agent, "ok", answer))
        return self.wait(0.0)

    def wait(self, seconds: float) -> list[End]:
        self.now_s += seconds
        return self.fleet.listen(0.0, self.now_s).get(CLIENT, [])


def event_of(end: End) -> Advanced:
    assert isinstance(end, ShardDone)
    assert isinstance(end.answer, Reached)
    return end.answer.event


def in_advance(**changes: Any) -> AnswerChange:  # noqa: ANN401 - of any field
    """Return a change of the advance of an answer."""

    def change(answer: AdvanceAnswer) -> AdvanceAnswer:
        assert answer.advance is not None
        return replace(answer, advance=replace(answer.advance, **changes))

    return change


def judging(change: Callable[[tuple[Judgement, ...]], object]) -> AnswerChange:
    def made(answer: AdvanceAnswer) -> AdvanceAnswer:
        assert answer.advance is not None
        return in_advance(judgements=change(answer.advance.judgements))(answer)

    return made


def first(**changes: Any) -> AnswerChange:  # noqa: ANN401 - of any field
    """Return a change of the first judgement."""
    return judging(lambda found: (replace(found[0], **changes), *found[1:]))


def fallen(birth: BirthId, step: int = 1500, z: float = 0.1) -> AnswerChange:
    """Return a change that reports a robot as a casualty, not as living."""

    def made(answer: AdvanceAnswer) -> AdvanceAnswer:
        assert answer.advance is not None
        judged = answer.advance.judgements
        rest = tuple(one for one in judged if one.birth != birth)
        dead = Casualty(birth, step, "fell", (0.0, 0.0, z))
        rows = poses_of(answer)
        names, times_s = rows["birth"].to_pylist(), rows["sim_time_s"].to_pylist()
        kept = [
            number != birth.number or time_s <= step * DT
            for number, time_s in zip(names, times_s, strict=True)
        ]
        change = in_advance(
            judgements=rest,
            casualties=(dead,),
            poses=stream(rows.filter(pa.array(kept))),
        )
        return change(answer)

    return made


def poses_of(answer: AdvanceAnswer) -> pa.Table:
    assert answer.advance is not None
    return read_columns("poses", answer.advance.poses)


def stream(rows: pa.Table) -> bytes:
    sink = pa.BufferOutputStream()
    with pa.ipc.new_stream(sink, rows.schema) as writer:
        writer.write_table(rows.combine_chunks())
    return bytes(sink.getvalue().to_pybytes())


def posed(change: Callable[[pa.Table], pa.Table]) -> AnswerChange:
    return lambda answer: in_advance(poses=stream(change(poses_of(answer))))(answer)


def column(name: str, value: object) -> AnswerChange:
    """Return a change of the last value of a column of the poses."""

    def change(rows: pa.Table) -> pa.Table:
        field = POSES.field(name)
        values = [*rows[name].to_pylist()[:-1], value]
        place = rows.schema.get_field_index(name)
        return rows.set_column(place, field, pa.array(values, field.type))

    return posed(change)


LIES: dict[str, AnswerChange] = {
    "another epoch": lambda answer: replace(answer, epoch=2),
    "another job": lambda answer: replace(answer, number=answer.number + 1),
    "an earlier step": in_advance(step=UNTIL),
    "a later step": in_advance(step=NEXT + 1),
    "a short digest": in_advance(digest=b"short"),
    "a missing robot": judging(lambda found: found[:-1]),
    "no robots": in_advance(judgements=()),
    "an unknown robot": judging(
        lambda found: (*found, replace(found[0], birth=STRANGER))
    ),
    "a robot that was removed": judging(
        lambda found: (replace(found[0], birth=FIRST), *found)
    ),
    "a robot twice": judging(lambda found: (found[0], *found)),
    "robots in another order": judging(lambda found: found[::-1]),
    "a robot alive and dead": in_advance(
        casualties=(Casualty(SECOND, 1500, "fell", (0.0, 0.0, 0.1)),)
    ),
    "a casualty before the advance": fallen(SECOND, step=UNTIL - 1),
    "a casualty after the advance": fallen(SECOND, step=NEXT + 1),
    "a casualty far away": fallen(SECOND, z=1e11),
    "fitness not a number": first(fitness=math.nan),
    "another age": first(age_s=NEXT * DT + DT),
    "negative age": first(age_s=-1.0),
    "mature too early": first(is_mature=True),
    "a measure that is not asked for": first(measures=(1.0,)),
    "a measure not a number": first(measures=(math.nan,)),
    "negative velocity": first(path_velocity=-1.0),
    "path shorter than the straight line": first(path_velocity=0.0),
    "a place far away": first(place=(0.0, 1e11, 0.0)),
    "touches that nobody asked for": in_advance(touches=(Touch(SECOND, THIRD, 0.5),)),
    "no snapshot": lambda answer: replace(answer, snapshot=b""),
    "a snapshot of another state": lambda answer: replace(answer, snapshot=b"{}"),
    "no state, though it came along": lambda answer: replace(
        answer, advance=None, snapshot=b""
    ),
    "no poses": in_advance(poses=b""),
    "a missing pose": posed(lambda rows: rows.slice(1)),
    "a pose twice": posed(lambda rows: pa.concat_tables([rows, rows.slice(49)])),
    "poses in another order": posed(lambda rows: rows.take(np.arange(50)[::-1])),
    "a pose of a stranger": column("birth", 9),
    "a pose on another island": column("island", 7),
    "a pose of an immigrant by name": column("birth_island", 7),
    "a pose at another time": column("sim_time_s", NEXT * DT - DT),
    "a pose before the advance": column("sim_time_s", 0.2),
    "a pose at no time": column("sim_time_s", math.nan),
    "a pose not finite": column("y", math.inf),
    "an attitude that is none": column("qw", 0.5),
    "an angle not a number": column("angles", [math.nan]),
    "an angle too many": column("angles", [0.5] * 2),
    "an angle too few": column("angles", []),
    "damaged poses": in_advance(poses=b"\xff" * 100),
}  # fmt: skip


@pytest.mark.parametrize("lie", LIES.values(), ids=LIES)
def test_false_advance_is_refused(lie: AnswerChange) -> None:
    two = Two()
    true = two.true_answer()
    liar = two.sent[-1][1]
    if true.advance and lie is LIES["no state, though it came along"]:
        two.answer(replace(true, advance=None, snapshot=b""))  # it lost its state
        assert two.fleet.faults.total("malformed") == 0
        true = replace(true, number=true.number + 1)
    assert two.answer(lie(true)) == []
    assert two.fleet.faults.total("malformed") == 1
    # The liar backs off. The other worker is given the state, and its answer counts.
    assert two.sent[-1][1] != liar
    request = decode_advance_request(two.sent[-1][2])
    assert request.rebuild is not None
    (end,) = two.answer(two.true_answer())
    event = event_of(end)
    assert [one.birth for one in event.advance.judgements] == [SECOND, THIRD]
    assert event.pose_rows == 50
    assert two.requests.commit(event) is None


def test_true_answers_are_taken() -> None:
    two = Two()
    (end,) = two.answer(two.true_answer())
    assert event_of(end).provenance.agent == two.sent[-1][1]
    assert two.fleet.faults.total("malformed") == 0


def test_a_robot_that_diverged_is_no_lie() -> None:
    two = Two()
    (end,) = two.answer(fallen(THIRD)(two.true_answer()))
    assert [one.birth for one in event_of(end).advance.judgements] == [SECOND]
    two.requests.commit(event_of(end))


def test_a_snapshot_that_nobody_wanted_is_refused() -> None:
    two = Two()
    (end,) = two.answer(two.true_answer())
    two.requests.commit(event_of(end))
    two.requests.send(AdvanceShard(0, 2, NEXT + 1000, Changes(), False))
    true = two.true_answer()
    assert true.snapshot == b""
    assert two.answer(replace(true, snapshot=b"x")) == []
    assert two.fleet.faults.total("malformed") == 1


TOUCH = Touch(SECOND, THIRD, 0.5)


@pytest.mark.parametrize(
    ("touches", "is_true"),
    [
        ((TOUCH,), True),
        ((replace(TOUCH, duration_s=5.0),), True),
        ((replace(TOUCH, duration_s=5.2),), False),
        ((replace(TOUCH, duration_s=0.0),), False),
        ((replace(TOUCH, second=SECOND),), False),
        ((replace(TOUCH, first=FIRST),), False),
        ((replace(TOUCH, second=STRANGER),), False),
        ((TOUCH, TOUCH), False),
    ],
)
def test_touches_are_of_robots_that_live(
    touches: tuple[Touch, ...], *, is_true: bool
) -> None:
    two = Two(has_touches=True)
    assert len(two.answer(in_advance(touches=touches)(two.true_answer()))) == is_true
    assert two.fleet.faults.total("malformed") == (not is_true)


@pytest.mark.parametrize(
    "message",
    [
        pb.AdvanceAnswer(snapshot=bytes(30_000_000)),
        pb.AdvanceAnswer(advance=pb.Advance(poses=bytes(30_000_000))),
        pb.AdvanceAnswer(
            advance=pb.Advance(casualties=[pb.Casualty(reason="x" * 30_000_000)])
        ),
    ],
    ids=["snapshot", "poses", "reason"],
)
def test_an_answer_of_30_mb_is_refused_unread(message: pb.AdvanceAnswer) -> None:
    two = Two()
    read = two.fleet._advance_reads[two.sent[-1][0]]
    with pytest.raises(MalformedMessage) as raised:
        read(message.SerializeToString())
    assert raised.value.kind == "too large"


def test_reasons_are_cut_to_one_printable_line() -> None:
    two = Two()
    true = fallen(THIRD)(two.true_answer())
    message = pb.AdvanceAnswer.FromString(encode_advance_answer(true))
    message.advance.casualties[0].reason = "\x1b[2Jfell\n" + "x" * 3000
    (end,) = two.answer(message.SerializeToString())
    (dead,) = event_of(end).advance.casualties
    assert dead.reason.startswith("?[2Jfell xxx")
    assert len(dead.reason) == 1000


def test_malformed_advances_never_stop_a_run() -> None:
    two = Two()
    for count in range(1, 6):
        assert two.answer(b"\xff") == []
        assert two.fleet.faults.total("malformed") == count
        two.wait(10.0)
    (end,) = two.answer(two.true_answer())
    assert event_of(end).advance.step == NEXT


TWO = Two()
TRUE = TWO.true_answer()
TRUE_BYTES = encode_advance_answer(TRUE)
READ = TWO.fleet._advance_reads[TWO.sent[-1][0]]


@given(data=st.data())
def test_mutated_answers_are_refused_or_fit_the_request(data: DataObject) -> None:
    """No error but ``MalformedMessage``, and never other robots or another step."""
    mutated = bytearray(TRUE_BYTES)
    for _ in range(data.draw(st.integers(1, 4))):
        place = data.draw(st.integers(0, len(mutated) - 1))
        mutated[place] = data.draw(st.integers(0, 255))
    del mutated[data.draw(st.integers(0, 2 * len(mutated))) :]
    with suppress(MalformedMessage):
        reached = READ(bytes(mutated))
        if reached is None:
            return
        assert isinstance(reached, Reached)
        advance: Advance = reached.event.advance
        assert advance.step == NEXT
        assert [one.birth for one in advance.judgements] == [SECOND, THIRD]
        assert all(math.isfinite(one.fitness) for one in advance.judgements)
        assert reached.event.pose_rows == 50
        assert sha256(reached.snapshot).digest() == advance.digest
