"""What a worker does with shards, in a world without physics."""

from dataclasses import replace

import pytest

from schema.errors import InvalidRobot, MalformedMessage, StateDiffers
from schema.experiment.file import read_experiment
from schema.experiment.identity import Origin
from schema.experiment.settings import arena_settings
from schema.parts import BUILT_IN
from schema.robot.genome import Node, develop
from schema.robot.ids import BirthId
from schema.robot.robot import Part, Robot
from schema.wire.arena import Advance, Changes, Insertion
from schema.wire.arena_codec import (
    AdvanceAnswer,
    AdvanceRequest,
    Live,
    PastAdvance,
    Rebuild,
    decode_advance_answer,
    decode_live,
    encode_advance_request,
    encode_live,
)
from tests.worker.fake_world import FakeWorld, OddWorld
from worker.serve.shards import MOST_HELD, Shards

SETTINGS = arena_settings(read_experiment("scenario3"), Origin())
EMPTY = Rebuild(b"", ())
CORE = develop(Node("Core", -1, 0, (0.5, 0.5, 0.5)), BUILT_IN)


def insertion(number: int, robot: Robot = CORE) -> Changes:
    return Changes(insertions=(Insertion(BirthId(0, number), robot, (0.5, 0.25)),))


class JobClient:
    """A coordinator of one shard: knows what came of each advance."""

    def __init__(self, run: str = "r", shard: int = 0) -> None:
        self.run, self.shard = run, shard
        self.step, self.digest = 0, b""
        self.history: list[PastAdvance] = []
        self.snapshot = b""

    def request(
        self,
        steps: int,
        changes: Changes | None = None,
        rebuild: Rebuild | None = None,
        *,
        keep: bool = False,
    ) -> bytes:
        return encode_advance_request(
            AdvanceRequest(
                run=self.run, epoch=1, number=7, settings=SETTINGS, shard=self.shard,
                from_step=self.step, from_digest=self.digest,
                changes=changes or Changes(), until=self.step + steps,
                wants_snapshot=keep, rebuild=rebuild,
            )
        )  # fmt: skip

    def ask(
        self,
        shards: Shards,
        steps: int = 100,
        changes: Changes | None = None,
        rebuild: Rebuild | None = None,
        *,
        keep: bool = False,
    ) -> AdvanceAnswer:
        """Ask, and remember what came of it."""
        request = self.request(steps, changes, rebuild, keep=keep)
        answer = decode_advance_answer(shards.answer(request))
        assert (answer.epoch, answer.number) == (1, 7)
        if answer.advance is not None:
            self.step, self.digest = answer.advance.step, answer.advance.digest
            past = PastAdvance(changes or Changes(), self.step, self.digest)
            self.history.append(past)
            if keep:
                self.snapshot, self.history = answer.snapshot, []
        return answer

    def whole(self) -> Rebuild:
        return Rebuild(self.snapshot, tuple(self.history))


def lived(shards: Shards) -> JobClient:
    """Return an asker whose shard has had two robots for a while."""
    requester = JobClient()
    requester.ask(shards, 100, insertion(0), EMPTY)
    requester.ask(shards, 100, insertion(1))
    return requester


def following(
    requester: JobClient, shards: Shards, rebuild: Rebuild | None
) -> Advance | None:
    request = requester.request(50, insertion(2), rebuild)
    return decode_advance_answer(shards.answer(request)).advance


def test_goes_on_from_the_state_that_it_holds() -> None:
    shards = Shards(FakeWorld)
    FakeWorld.made = 0
    lived(shards)
    assert FakeWorld.made == 1
    assert shards.held == [("r", 0)]


@pytest.mark.parametrize("keep", [False, True])
def test_another_worker_comes_to_the_same(keep: bool) -> None:  # noqa: FBT001 - a case
    first = Shards(FakeWorld)
    requester = lived(first)
    requester.ask(first, 300, keep=keep)
    requester.ask(first, 10, Changes(removals=(BirthId(0, 0),)))
    assert bool(requester.snapshot) == keep
    rebuilt = following(requester, Shards(FakeWorld), requester.whole())
    assert rebuilt is not None
    assert rebuilt == following(requester, first, None)


def test_a_snapshot_without_history_is_enough() -> None:
    first = Shards(FakeWorld)
    requester = lived(first)
    requester.ask(first, 300, keep=True)
    assert requester.history == []
    second = Shards(FakeWorld)
    assert following(requester, second, requester.whole()) == following(
        requester, first, None
    )


def test_without_the_state_it_asks_for_it() -> None:
    requester = lived(Shards(FakeWorld))
    assert following(requester, Shards(FakeWorld), None) is None


def test_a_state_that_went_on_is_not_the_one_to_start_from() -> None:
    # Its answer was lost: the coordinator stands where the worker stood.
    shards = Shards(FakeWorld)
    requester = lived(shards)
    first = following(requester, shards, None)
    assert following(requester, shards, None) is None
    assert shards.held == []
    assert following(requester, shards, requester.whole()) == first


def test_other_digest_same_step_is_another_state() -> None:
    shards = Shards(FakeWorld)
    requester = lived(shards)
    requester.digest = bytes(32)
    assert following(requester, shards, None) is None


def test_a_machine_that_computes_otherwise_is_found_out() -> None:
    requester = lived(Shards(FakeWorld))
    odd = Shards(OddWorld)
    with pytest.raises(StateDiffers, match=r"at step 100 .* computes otherwise"):
        odd.answer(requester.request(50, None, requester.whole()))
    assert odd.held == []


def test_a_snapshot_of_another_state_is_found_out() -> None:
    first = Shards(FakeWorld)
    requester = lived(first)
    requester.ask(first, 300, keep=True)
    requester.snapshot = requester.snapshot.replace(b"[0, 1,", b"[0, 2,")
    with pytest.raises(StateDiffers, match="at step 500"):
        Shards(FakeWorld).answer(requester.request(50, None, requester.whole()))


def test_a_history_that_ends_elsewhere_is_found_out() -> None:
    requester = lived(Shards(FakeWorld))
    rebuild = Rebuild(b"", tuple(requester.history[:1]))
    with pytest.raises(StateDiffers, match="rebuilt to step 100, must be 200"):
        Shards(FakeWorld).answer(requester.request(50, None, rebuild))


def test_a_robot_that_breaks_the_rules_changes_nothing() -> None:
    shards = Shards(FakeWorld)
    requester = lived(shards)
    strange = Robot((Part("Wheelbarrow", -1, -1, -1, 0, ()),))
    with pytest.raises(InvalidRobot, match="Wheelbarrow"):
        shards.answer(requester.request(50, insertion(2, strange)))
    assert following(requester, shards, None) is not None


def test_runs_and_shards_do_not_meet() -> None:
    shards = Shards(FakeWorld)
    clients = [JobClient("a", 0), JobClient("a", 1), JobClient("b", 0)]
    for requester in clients:
        requester.ask(shards, 100, insertion(0), EMPTY)
    for requester in clients:
        assert requester.ask(shards).advance is not None


def test_the_one_that_rested_longest_goes_first() -> None:
    shards = Shards(FakeWorld)
    clients = [JobClient(shard=number) for number in range(MOST_HELD + 1)]
    for requester in clients[:-1]:
        requester.ask(shards, rebuild=EMPTY)
    clients[0].ask(shards)
    clients[-1].ask(shards, rebuild=EMPTY)
    assert clients[0].ask(shards).advance is not None
    assert clients[1].ask(shards).advance is None
    assert len(shards.held) == MOST_HELD


def test_those_who_watch_see_each_advance() -> None:
    seen: list[Live] = []
    requester = lived(Shards(FakeWorld, publish=seen.append))
    assert [(live.run, live.shard, live.advance.step) for live in seen] == [
        ("r", 0, 100),
        ("r", 0, 200),
    ]
    assert seen[1].advance.digest == requester.digest
    assert decode_live(encode_live(seen[1])) == seen[1]


def test_other_bytes_are_refused() -> None:
    with pytest.raises(MalformedMessage):
        Shards(FakeWorld).answer(b"\xff\xff")


def test_what_was_elsewhere_is_done_again_as_nearly_as_it_goes() -> None:
    """Who fell only here is not asked for, who fell only there does not stay."""
    requester = lived(Shards(FakeWorld))
    fallen = Changes(removals=(BirthId(0, 9),), insertions=insertion(2).insertions)
    requester.history.append(PastAdvance(fallen, 300, b"\0" * 32))
    requester.step, requester.digest = 300, b"\1" * 32
    with pytest.raises(KeyError):
        requester.ask(Shards(FakeWorld), 10, None, requester.whole())
    rebuild = replace(requester.whole(), living=(BirthId(0, 0), BirthId(0, 7)))
    gone = Changes(removals=(BirthId(0, 7),))
    advance = requester.ask(Shards(FakeWorld), 10, gone, rebuild).advance
    assert advance is not None
    told = {one.birth for one in advance.judgements}
    assert told | {one.birth for one in advance.casualties} == {BirthId(0, 0)}
