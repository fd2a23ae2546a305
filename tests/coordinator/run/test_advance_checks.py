"""Answers about arenas that contradict their requests or the arena's state."""

import math
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.strategies import DataObject
from msgspec.structs import replace

from coordinator.dispatch.events import Client, Deliver, Joined, Read
from coordinator.dispatch.fleet import JobRouter
from coordinator.islands.events import Advanced
from coordinator.run.run_context import RunContext
from coordinator.run.shard_answers import Reached
from coordinator.run.shard_requests import ShardRequests
from coordinator.storage.snapshots import Snapshots
from schema.agent.request_handler import answer as answer_to
from schema.errors import MalformedMessage
from schema.experiment.identity import Origin
from schema.limits import ADVANCE_BYTES, ADVANCE_REQUEST_BYTES
from schema.robot.ids import BirthId
from schema.wire.arena import (
    NO_POSES,
    Advance,
    AdvanceShard,
    Casualty,
    Changes,
    Insertion,
    Judgement,
    Poses,
    Touch,
)
from schema.wire.arena_state import state_digest
from schema.wire.codec import decode, encode
from schema.wire.messages import Answer, Request, StateMissing
from schema.wire.poses import PoseArrays
from tests.coordinator.arena_world import DT, experiment
from tests.coordinator.sent_requests import JUDGED, ROBOT, SentJobs
from tests.worker.fake_world import FakeWorld
from worker.serve.jobs import Jobs
from worker.serve.shards import Shards

CLIENT = Client("run", 3)
FIRST, SECOND, THIRD = (BirthId(0, number) for number in range(3))
STRANGER = BirthId(0, 9)
UNTIL, NEXT = 1000, 2000

AdvanceChange = Callable[[Advance], Advance]


class NoDeaths(FakeWorld):
    """World in which all robots live on."""

    def _chance(self, birth: BirthId) -> float:
        return max(0.02, super()._chance(birth))


class Kept(Snapshots):
    """Snapshots in memory."""

    def __init__(self) -> None:
        super().__init__(Path())
        self.data: dict[tuple[int, int], bytes] = {}

    def has(self, shard: int, step: int, digest: bytes) -> bool:
        data = self.data.get((shard, step))
        return data is not None and state_digest(data) == digest

    def write(self, shard: int, step: int, data: bytes) -> None:
        self.data[shard, step] = data

    def read(self, shard: int, step: int) -> bytes:
        return self.data[shard, step]

    def drop_before(self, shard: int, step: int, kept: int = 0) -> None:
        del shard, step, kept


class Two(SentJobs):
    """An arena and two workers; the test answers for them.

    After its first advance three robots live: one was removed, one inserted.
    """

    def __init__(self, *, has_touches: bool = False) -> None:
        super().__init__()
        self.fleet = JobRouter(self)
        rules = experiment(9, record_touches=has_touches)
        context = RunContext.of("run", 3, rules, Origin())
        self.requests = ShardRequests(context, Kept(), self.fleet)
        self.workers = {name: Jobs(Shards(NoDeaths)) for name in ("one", "two")}
        for name in self.workers:
            self.fleet.tell(Joined(name, "worker", 1, "any"))
        founders = tuple(Insertion(each, ROBOT, (0.0, 0.0)) for each in (FIRST, SECOND))
        self.requests.send(AdvanceShard(0, 0, UNTIL, Changes((), founders), False))
        (end,) = self.ended_by(self.true_answer())
        self.requests.commit(event_of(end))
        changes = Changes((FIRST,), (Insertion(THIRD, ROBOT, (1.0, 0.0)),))
        self.requests.send(AdvanceShard(0, 1, NEXT, changes, True))

    @property
    def request(self) -> Request:
        """The newest request."""
        return decode(Request, self.sent[-1][2], ADVANCE_REQUEST_BYTES)

    def true_answer(self) -> Answer:
        """Return the answer of an honest worker to the newest request."""
        worker = self.workers[self.sent[-1][1]]
        return decode(Answer, answer_to(worker.answer, self.request), ADVANCE_BYTES)

    def ended_by(self, answer: Answer | bytes) -> list[Deliver]:
        """Answer the newest request; return what ended."""
        self.answer(data=answer if isinstance(answer, bytes) else encode(answer))
        return self.fleet.listen(0.0, 0.0).get(CLIENT, [])

    @property
    def read(self) -> Read:
        """The reader of the answer to the newest request."""
        number, agent, _ = self.sent[-1]
        job = self.fleet.dispatch.job(number)
        assert job is not None
        _, read = job.sent[number, agent]
        return read


def event_of(end: Deliver) -> Advanced:
    assert isinstance(end.answer, Reached)
    return end.answer.event


def changed(answer: Answer, change: AdvanceChange) -> Answer:
    """Return an answer whose advance is changed."""
    assert isinstance(answer.result, Advance)
    return replace(answer, result=change(answer.result))


def having(**changes: Any) -> AdvanceChange:  # noqa: ANN401 - of any field
    """Return a change of some fields."""
    return lambda advance: replace(advance, **changes)


def judging(change: Callable[[tuple[Judgement, ...]], object]) -> AdvanceChange:
    """Return a change of the judgements."""
    return lambda advance: replace(advance, judgements=change(advance.judgements))


def first(**changes: Any) -> AdvanceChange:  # noqa: ANN401 - of any field
    """Return a change of the first judgement."""
    return judging(lambda found: (replace(found[0], **changes), *found[1:]))


def fallen(
    birth: BirthId, step: int = 1500, z: float = 0.1, reason: str = "fell"
) -> AdvanceChange:
    """Return a change that reports a robot as a casualty, not as living."""

    def change(advance: Advance) -> Advance:
        rest = tuple(one for one in advance.judgements if one.birth != birth)
        dead = Casualty(birth, step, reason, (0.0, 0.0, z))
        return replace(advance, judgements=rest, casualties=(dead,))

    return change


def posed(order: Sequence[int]) -> AdvanceChange:
    """Return a change of the poses to some of them; each has one angle."""

    def made(advance: Advance) -> Advance:
        poses = PoseArrays.received(advance.poses)._asdict()
        chosen = PoseArrays(**{name: poses[name][list(order)] for name in poses})
        return replace(advance, poses=chosen.message())

    return made


def column(name: str, value: float, place: int = 0) -> AdvanceChange:
    """Return a change of a number of the last pose."""

    def made(advance: Advance) -> Advance:
        columns = PoseArrays.received(advance.poses)._asdict()
        columns[name] = columns[name].copy()
        columns[name][-1:, ...].flat[place] = value
        return replace(advance, poses=PoseArrays(**columns).message())

    return made


def many_angles(advance: Advance) -> Advance:
    """Give the last pose more joints than a body has parts."""
    poses = PoseArrays.received(advance.poses)
    joints = np.array([*poses.joints[:-1], 1000], np.int32)
    angles = np.zeros(joints.sum(), np.float32)
    return replace(
        advance, poses=poses._replace(joints=joints, angles=angles).message()
    )


LIES: dict[str, AdvanceChange] = {
    "an earlier step": having(step=UNTIL),
    "a later step": having(step=NEXT + 1),
    "a short digest": having(digest=b"short"),
    "a missing robot": judging(lambda found: found[:-1]),
    "no robots": having(judgements=()),
    "an unknown robot": judging(
        lambda found: (*found, replace(found[0], birth=STRANGER))
    ),
    "a robot that was removed": judging(
        lambda found: (replace(found[0], birth=FIRST), *found)
    ),
    "a robot twice": judging(lambda found: (found[0], *found)),
    "robots in another order": judging(lambda found: found[::-1]),
    "a robot alive and dead": having(
        casualties=(Casualty(SECOND, 1500, "fell", (0.0, 0.0, 0.1)),)
    ),
    "a casualty before the advance": fallen(SECOND, step=UNTIL - 1),
    "a casualty after the advance": fallen(SECOND, step=NEXT + 1),
    "fitness not a number": first(fitness=math.nan),
    "a measure that is not asked for": first(measures=(1.0,)),
    "a measure not a number": first(measures=(math.nan,)),
    "a place not finite": first(place=(0.0, math.inf, 0.0)),
    "a casualty at no place": fallen(SECOND, z=math.nan),
    "touches that are not recorded": having(touches=(Touch(SECOND, THIRD, 0.5),)),
    "no snapshot": having(snapshot=b""),
    "a snapshot of another state": having(snapshot=b"{}"),
    "a pose twice": posed([*range(50), 49]),
    "no poses": having(poses=NO_POSES),
    "a pose too few": posed(range(1, 50)),
    "poses in another order": posed(range(50)[::-1]),
    "a pose of a stranger": column("births", 9),
    "a pose on another island": column("islands", 7),
    "a pose at another time": column("times_s", NEXT * DT - DT),
    "a pose before the advance": column("times_s", 0.2),
    "a pose at no time": column("times_s", math.nan),
    "a pose not finite": column("cores", math.inf, 1),
    "an attitude not a number": column("cores", math.nan, 3),
    "an angle not a number": column("angles", math.nan),
    "more angles than a body has joints": many_angles,
    "columns of different lengths": having(poses=Poses(b"\0" * 4)),
}  # fmt: skip


def check_refused(two: Two, lie: Answer | bytes) -> None:
    """Fail unless a lie is counted, its worker backs off, and the other is believed."""
    liar, before = two.sent[-1][1], two.fleet.faults.total("malformed")
    assert two.ended_by(lie) == []
    assert two.fleet.faults.total("malformed") == before + 1
    # The other worker is given the state.
    assert two.sent[-1][1] != liar
    assert isinstance(two.request.work, AdvanceShard)
    assert two.request.work.rebuild is not None
    (end,) = two.ended_by(two.true_answer())
    event = event_of(end)
    assert [one.birth for one in event.advance.judgements] == [SECOND, THIRD]
    assert event.pose_rows == 50
    assert two.requests.commit(event) is None


@pytest.mark.parametrize("lie", LIES.values(), ids=LIES)
def test_false_advance_is_refused(lie: AdvanceChange) -> None:
    two = Two()
    check_refused(two, changed(two.true_answer(), lie))


@pytest.mark.parametrize(
    "fields",
    [{"epoch": 2}, {"number": 77}, {"result": JUDGED}, {"wall_s": math.nan}],
    ids=str,
)
def test_answer_to_another_request_is_refused(fields: dict[str, Any]) -> None:
    two = Two()
    check_refused(two, replace(two.true_answer(), **fields))


def test_a_worker_may_lack_the_state_unless_it_came_along() -> None:
    two = Two()
    answer = two.true_answer()
    two.ended_by(replace(answer, result=StateMissing()))
    assert two.fleet.faults.total("malformed") == 0
    number = two.sent[-1][0]
    check_refused(two, replace(answer, number=number, result=StateMissing()))


def test_a_snapshot_that_nobody_wanted_is_refused() -> None:
    two = Two()
    (end,) = two.ended_by(two.true_answer())
    assert event_of(end).provenance.agent == two.sent[-1][1]
    two.requests.commit(event_of(end))
    two.requests.send(AdvanceShard(0, 2, NEXT + 1000, Changes(), False))
    true = two.true_answer()
    assert isinstance(true.result, Advance)
    assert true.result.snapshot == b""
    assert two.ended_by(changed(true, having(snapshot=b"x"))) == []
    assert two.fleet.faults.total("malformed") == 1


TOUCH = Touch(SECOND, THIRD, 0.5)


@pytest.mark.parametrize(
    ("touches", "is_true"),
    [
        ((TOUCH,), True),
        ((replace(TOUCH, duration_s=5.0),), True),
        ((replace(TOUCH, duration_s=math.inf),), False),
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
    answer = changed(two.true_answer(), having(touches=touches))
    assert len(two.ended_by(answer)) == is_true
    assert two.fleet.faults.total("malformed") == (not is_true)


def test_an_answer_that_is_too_large_is_refused_unread() -> None:
    with pytest.raises(MalformedMessage) as raised:
        Two().read(bytes(ADVANCE_BYTES + 1))
    assert raised.value.kind == "too large"


def test_reasons_are_cut_to_one_printable_line() -> None:
    two = Two()
    reason = "\x1b[2Jfell\n" + "x" * 30_000_000
    (end,) = two.ended_by(changed(two.true_answer(), fallen(THIRD, reason=reason)))
    (dead,) = event_of(end).advance.casualties
    assert dead.reason.startswith("?[2Jfell xxx")
    assert len(dead.reason) == 1000
    assert [one.birth for one in event_of(end).advance.judgements] == [SECOND]
    two.requests.commit(event_of(end))


TWO = Two()
TRUE_BYTES = encode(TWO.true_answer())


@given(data=st.data())
def test_mutated_answers_are_refused_or_fit_the_request(data: DataObject) -> None:
    """No error but ``MalformedMessage``, and never other robots or another step."""
    mutated = bytearray(TRUE_BYTES)
    for _ in range(data.draw(st.integers(1, 4))):
        place = data.draw(st.integers(0, len(mutated) - 1))
        mutated[place] = data.draw(st.integers(0, 255))
    del mutated[data.draw(st.integers(0, 2 * len(mutated))) :]
    with suppress(MalformedMessage):
        reached = TWO.read(bytes(mutated))
        if reached is None:
            return
        assert isinstance(reached, Reached)
        advance: Advance = reached.event.advance
        assert advance.step == NEXT
        assert [one.birth for one in advance.judgements] == [SECOND, THIRD]
        assert all(math.isfinite(one.fitness) for one in advance.judgements)
        assert reached.event.pose_rows <= 50
        assert state_digest(reached.snapshot) == advance.digest
