"""Arena shards of a worker, in a world without physics."""

from functools import partial

import pytest
from msgspec.structs import replace

from schema.agent.service import Outlet
from schema.errors import InvalidRobot, MalformedMessage, StateDiffers
from schema.experiment.file import read_experiment
from schema.experiment.identity import Origin
from schema.experiment.settings import arena_settings
from schema.limits import LIVE_BYTES
from schema.parts import BUILT_IN
from schema.robot.genome import Node, develop
from schema.robot.ids import BirthId
from schema.robot.robot import Part, Robot
from schema.wire.arena import (
    Advance,
    AdvanceShard,
    Changes,
    Insertion,
    Live,
    PastAdvance,
    Rebuild,
)
from schema.wire.codec import decode
from schema.wire.messages import Request, StateMissing
from tests.worker.fake_world import FakeWorld, OddWorld
from worker.serve.shards import Shards as AnyShards

MOST_HELD = 3
Shards = partial(AnyShards, most_held=MOST_HELD)
SETTINGS = arena_settings(read_experiment("scenario3"), Origin())
EMPTY = Rebuild(b"", ())
CORE = develop(Node("Core", -1, 0, (0.5, 0.5, 0.5)), BUILT_IN)


def insertion(number: int, robot: Robot = CORE) -> Changes:
    return Changes(insertions=(Insertion(BirthId(0, number), robot, (0.5, 0.25)),))


class JobClient:
    """Coordinator of one shard, with the history of its advances."""

    def __init__(self, run: str = "r", shard: int = 0) -> None:
        self.run, self.shard = run, shard
        self.step, self.digest = 0, b""
        self.history: list[PastAdvance] = []
        self.snapshot = b""

    def work(
        self,
        steps: int,
        changes: Changes | None = None,
        rebuild: Rebuild | None = None,
        *,
        keep: bool = False,
    ) -> AdvanceShard:
        """Return an advance from the newest state."""
        return AdvanceShard(
            self.shard,
            0,
            self.step + steps,
            changes or Changes(),
            wants_snapshot=keep,
            from_step=self.step,
            from_digest=self.digest,
            rebuild=rebuild,
        )

    def ask(
        self,
        shards: AnyShards,
        steps: int = 100,
        changes: Changes | None = None,
        rebuild: Rebuild | None = None,
        *,
        keep: bool = False,
    ) -> Advance | None:
        """Request an advance and record it; return None without the state."""
        advance = self.send(shards, self.work(steps, changes, rebuild, keep=keep))
        if advance is not None:
            self.step, self.digest = advance.step, advance.digest
            past = PastAdvance(changes or Changes(), self.step, self.digest)
            self.history.append(past)
            if keep:
                self.snapshot, self.history = advance.snapshot, []
        return advance

    def send(self, shards: AnyShards, work: AdvanceShard) -> Advance | None:
        request = Request(self.run, 1, 7, work, SETTINGS)
        result = shards.answer(request, work)
        return None if isinstance(result, StateMissing) else result

    def whole(self) -> Rebuild:
        return Rebuild(self.snapshot, tuple(self.history))


def lived(shards: AnyShards) -> JobClient:
    """Return a client whose shard has had two advances with two robots."""
    requester = JobClient()
    requester.ask(shards, 100, insertion(0), EMPTY)
    requester.ask(shards, 100, insertion(1))
    return requester


def following(
    requester: JobClient, shards: AnyShards, rebuild: Rebuild | None
) -> Advance | None:
    return requester.send(shards, requester.work(50, insertion(2), rebuild))


def test_advance_continues_from_the_kept_state() -> None:
    shards = Shards(FakeWorld)
    FakeWorld.made = 0
    lived(shards)
    assert FakeWorld.made == 1


@pytest.mark.parametrize(
    ("keep", "has_more"), [(False, True), (True, True), (True, False)]
)
def test_rebuilt_shard_advances_like_the_original(
    *, keep: bool, has_more: bool
) -> None:
    first = Shards(FakeWorld)
    requester = lived(first)
    requester.ask(first, 300, keep=keep)
    if has_more:
        requester.ask(first, 10, Changes(removals=(BirthId(0, 0),)))
    assert bool(requester.snapshot) == keep
    assert bool(requester.history) == has_more
    rebuilt = following(requester, Shards(FakeWorld), requester.whole())
    assert rebuilt is not None
    assert rebuilt == following(requester, first, None)


def test_answer_asks_for_a_missing_state() -> None:
    requester = lived(Shards(FakeWorld))
    assert following(requester, Shards(FakeWorld), None) is None


def test_state_that_is_ahead_of_the_request_is_dropped() -> None:
    # After a lost answer the coordinator is one advance behind the worker.
    shards = Shards(FakeWorld)
    requester = lived(shards)
    first = following(requester, shards, None)
    assert following(requester, shards, None) is None
    assert following(requester, shards, requester.whole()) == first


def test_state_with_another_digest_is_not_used() -> None:
    shards = Shards(FakeWorld)
    requester = lived(shards)
    requester.digest = bytes(32)
    assert following(requester, shards, None) is None


def test_rebuild_on_a_machine_with_different_results_is_rejected() -> None:
    requester = lived(Shards(FakeWorld))
    odd = Shards(OddWorld)
    with pytest.raises(StateDiffers, match=r"at step 100 .* results differ"):
        requester.send(odd, requester.work(50, None, requester.whole()))
    assert following(requester, odd, None) is None


def test_snapshot_with_another_digest_is_rejected() -> None:
    first = Shards(FakeWorld)
    requester = lived(first)
    requester.ask(first, 300, keep=True)
    requester.snapshot = requester.snapshot.replace(b"[0, 1,", b"[0, 2,")
    with pytest.raises(StateDiffers, match="at step 500"):
        requester.send(Shards(FakeWorld), requester.work(50, None, requester.whole()))


def test_history_that_ends_at_another_step_is_rejected() -> None:
    requester = lived(Shards(FakeWorld))
    rebuild = Rebuild(b"", tuple(requester.history[:1]))
    with pytest.raises(StateDiffers, match="rebuilt to step 100, must be 200"):
        requester.send(Shards(FakeWorld), requester.work(50, None, rebuild))


def test_invalid_robot_leaves_the_shard_unchanged() -> None:
    shards = Shards(FakeWorld)
    requester = lived(shards)
    strange = Robot((Part("Wheelbarrow", -1, -1, -1, 0, ()),))
    with pytest.raises(InvalidRobot, match="Wheelbarrow"):
        requester.send(shards, requester.work(50, insertion(2, strange)))
    assert following(requester, shards, None) is not None


def test_shards_of_different_runs_are_independent() -> None:
    shards = Shards(FakeWorld)
    clients = [JobClient("a", 0), JobClient("a", 1), JobClient("b", 0)]
    for requester in clients:
        requester.ask(shards, 100, insertion(0), EMPTY)
    for requester in clients:
        assert requester.ask(shards) is not None


def test_least_recently_used_shard_is_dropped_first() -> None:
    shards = Shards(FakeWorld)
    clients = [JobClient(shard=number) for number in range(MOST_HELD + 1)]
    for requester in clients[:-1]:
        requester.ask(shards, rebuild=EMPTY)
    clients[0].ask(shards)
    clients[-1].ask(shards, rebuild=EMPTY)
    assert clients[0].ask(shards) is not None
    assert clients[1].ask(shards) is None
    assert clients[2].ask(shards) is not None


KEYS = {0: "fleet/poses/0"}


class Viewers(Outlet):
    """An outlet that keeps what is published while viewers are there."""

    def __init__(self) -> None:
        super().__init__()
        self.are_there = False
        self.put_at: list[tuple[str, bytes]] = []

    def has_listeners(self, key: str) -> bool:
        return self.are_there and key in KEYS.values()

    def put(self, key: str, data: bytes) -> None:
        self.put_at.append((key, data))


def test_each_advance_is_published_to_viewers() -> None:
    outlet = Viewers()
    lived(Shards(FakeWorld, outlet=outlet, key_of=KEYS.__getitem__))
    assert outlet.put_at == []
    outlet.are_there = True
    requester = lived(Shards(FakeWorld, outlet=outlet, key_of=KEYS.__getitem__))
    assert [key for key, _ in outlet.put_at] == [KEYS[0], KEYS[0]]
    seen = [decode(Live, data, LIVE_BYTES) for _, data in outlet.put_at]
    assert [(live.run, live.shard, live.advance.step) for live in seen] == [
        ("r", 0, 100),
        ("r", 0, 200),
    ]
    assert seen[1].advance.digest == requester.digest


def test_an_end_before_the_start_is_malformed() -> None:
    requester = lived(Shards(FakeWorld))
    with pytest.raises(MalformedMessage, match="until: must be >= from_step = 200"):
        requester.ask(Shards(FakeWorld), -1)


def test_history_of_another_platform_is_approximated() -> None:
    """Deaths only in the rebuilt arena are ignored; recorded deaths are applied."""
    requester = lived(Shards(FakeWorld))
    changes = Changes(removals=(BirthId(0, 9),), insertions=insertion(2).insertions)
    requester.history.append(PastAdvance(changes, 300, b"\0" * 32))
    requester.step, requester.digest = 300, b"\1" * 32
    with pytest.raises(KeyError):
        requester.ask(Shards(FakeWorld), 10, None, requester.whole())
    rebuild = replace(requester.whole(), living=(BirthId(0, 0), BirthId(0, 7)))
    gone = Changes(removals=(BirthId(0, 7),))
    advance = requester.ask(Shards(FakeWorld), 10, gone, rebuild)
    assert advance is not None
    births = {judgement.birth for judgement in advance.judgements}
    births |= {casualty.birth for casualty in advance.casualties}
    assert births == {BirthId(0, 0)}
