"""An arena that the coordinator advances in parts is equal to the whole one."""

from itertools import pairwise

import numpy as np
import pytest
from msgspec import json, structs

from coordinator.parts import arena_parts
from coordinator.parts.arena_parts import AGAIN, ArenaParts
from coordinator.run.advance_checks import ExpectedAdvance
from coordinator.run.shard_answers import PartReached, read_part
from schema.experiment.settings import ArenaSettings, read_arena_settings
from schema.parts import Vector
from schema.robot.ids import BirthId
from schema.robot.results import Provenance
from schema.wire.arena import Advance, AdvanceShard, Changes
from schema.wire.codec import encode
from schema.wire.messages import Answer, Request, StateMissing
from tests.worker.arena_cases import EXPERIMENT, SECOND, crowd, populated, settings_of
from tests.worker.conftest import random_robot
from worker.arena.world import World
from worker.serve.shards import Shards

FIRST, CHECK_S = 400, 0.04
ENDS = (FIRST, 600, 800, 1300, 1400, 2200)


class Fleet:
    """Workers that each hold some parts; one forgets all it has, now and then."""

    def __init__(self, settings: ArenaSettings, workers: int) -> None:
        self.shards = [Shards(World) for _ in range(workers)]
        self.settings, self.data = settings, json.encode(settings)
        self.asked = self.forgotten = 0
        self.experiment = structs.replace(EXPERIMENT, arena=settings.arena)

    def answer(self, arena: ArenaParts, part: int) -> None:
        """Let a worker advance a part."""
        place = 0 if part == AGAIN else part % len(self.shards)
        self.asked += 1
        if self.asked % 4 == 0:
            self.shards[place] = Shards(World)
            self.forgotten += 1
        for is_whole in (part == AGAIN, True):
            work = arena.request(part, is_whole=is_whole)
            request = Request("run", 0, self.asked, work, self.data)
            result = self.shards[place].answer(request, work)
            if isinstance(result, Advance) or is_whole:
                break
        assert not isinstance(result, StateMissing)
        assert work.part is not None
        reached = read_part(
            encode(Answer(0, self.asked, 0.5, result)),
            job=(0, self.asked),
            is_whole=is_whole,
            expected=ExpectedAdvance(
                work.from_step,
                work.until,
                arena.robots(part),
                self.experiment,
                wants_snapshot=False,
                wants_tracks=work.wants_tracks,
                judges=work.part.judges,
            ),
            provenance=Provenance(),
        )
        assert isinstance(reached, PartReached)
        arena.take(part, reached.result)

    def advance(
        self, arena: ArenaParts, requested: AdvanceShard, places: dict[BirthId, Vector],
        count: int,
    ) -> Advance:  # fmt: skip
        """Advance an arena in a number of parts."""
        arena.begin(requested, places, count)
        while True:
            for part in arena.missing:
                self.answer(arena, part)
            while arena.overlap():
                self.answer(arena, AGAIN)
            if (advance := arena.end(count)) is not None:
                return advance


def requests(
    world: World, seed: int
) -> list[tuple[AdvanceShard, dict[BirthId, Vector], Advance]]:
    """Advance a world; return what it was asked, the places before, what it answered.

    Robots are born, and a random one dies, before each advance.
    """
    rng, found = np.random.default_rng(seed), []
    advance = world.advance(FIRST)
    for number, (begin, end) in enumerate(pairwise(ENDS)):
        places = {one.birth: one.place for one in advance.judgements}
        gone = list(places)[int(rng.integers(len(places)))]
        born = crowd(random_robot, 2, 1.5, seed=number, first=100 + 2 * number)
        changes = Changes((gone,), born if number % 2 else ())
        world.apply(changes)
        advance = world.advance(end, work_j={})
        work = AdvanceShard(0, number, end, changes, False, True, from_step=begin)
        found.append((work, places, advance))
    return found


@pytest.mark.parametrize(
    ("radius_m", "count", "workers", "growth_m"),
    [
        (2.5, 3, 2, 0.05),
        # Robots that are near each other are divided nevertheless.
        (1.5, 2, 2, -1.0),
        (1.0, 4, 3, -1.0),
        # All of them touch.
        (0.5, 2, 2, 0.05),
        (2.5, 1, 1, 0.05),
    ],
)
def test_an_arena_in_parts_is_equal_to_the_whole(
    radius_m: float, count: int, workers: int, growth_m: float,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    monkeypatch.setattr(arena_parts, "GROWTH_M", growth_m)
    touching = settings_of(record_touches=True)
    settings = read_arena_settings(json.encode(touching))
    world, twin = (
        populated(settings, crowd(random_robot, 12, radius_m)) for _ in range(2)
    )
    twin.advance(FIRST)
    arena = ArenaParts(twin.state(), CHECK_S, SECOND)
    fleet = Fleet(settings, workers)
    for work, places, whole in requests(world, count):
        parts = fleet.advance(arena, work, places, count)
        assert parts.poses == whole.poses
        assert structs.replace(parts, poses=whole.poses) == whole
    assert fleet.forgotten > 0
    assert (arena.came.total() > 0) == (count > 1)
    assert arena.repeats > 0 or growth_m > 0.0
