"""Advances of real arenas pass every check."""

from collections.abc import Iterator
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from coordinator.evolution.generation import generate
from coordinator.run.advance_checks import ExpectedAdvance, check_advance, check_poses
from schema.experiment.document import Experiment, body_space
from schema.experiment.identity import Origin
from schema.experiment.settings import arena_settings, read_arena_settings
from schema.limits import ADVANCE_BYTES
from schema.robot.brain import Brain
from schema.robot.genome import develop
from schema.robot.ids import BirthId
from schema.wire.arena import Advance, BrainChange, Changes, Insertion
from schema.wire.codec import decode, encode
from tests.coordinator.arena_world import experiment
from worker.arena.world import World

TICK = 25


def settings_of(*, arena: dict[str, Any], simulation: dict[str, Any]) -> Experiment:
    made = experiment(9, **arena)
    return replace(made, simulation=replace(made.simulation, **simulation))


def advances(
    rules: Experiment, stops: list[int]
) -> Iterator[tuple[Advance, ExpectedAdvance]]:
    """Advance a crowd from stop to stop; robots come and go at each.

    The brain of one of those that stay is replaced by itself, and its window restarts.
    """
    settings = read_arena_settings(arena_settings(rules, Origin()))
    world, space = World(settings), body_space(rules.space)
    brains: dict[BirthId, Brain] = {}
    try:
        for number, (begin, end) in enumerate(pairwise([0, *stops])):
            living = list(world.births)
            came: list[Insertion] = []
            gone: list[BirthId] = []
            if begin % TICK == 0:
                for place in range(3):
                    birth = BirthId(number % 2, 3 * number + place)
                    genome = generate(np.random.default_rng(birth.number), rules)
                    at = (0.1 * place, 0.05 * number)
                    came.append(Insertion(birth, develop(genome, space), at))
                gone = living[:1]
            stay = living[-1:] if begin % settings.simulation.pose_steps == 0 else []
            again = tuple(BrainChange(birth, brains[birth], True) for birth in stay)
            world.apply(Changes(tuple(gone), tuple(came), again))
            brains |= {each.birth: each.robot.brain for each in came}
            expected = ExpectedAdvance(begin, end, set(world.births), rules, True)
            advance = world.advance(end)
            yield replace(advance, snapshot=world.snapshot()), expected
    finally:
        world.close()


def check(advance: Advance, expected: ExpectedAdvance) -> int:
    """Fail if a check refuses an advance; return the number of its poses."""
    received = decode(Advance, encode(advance), ADVANCE_BYTES)
    assert received == advance
    check_advance(received, expected)
    return check_poses(received, expected)


CASES: dict[str, tuple[dict[str, Any], dict[str, Any]]] = {
    "thesis": ({}, {}),
    "touches": ({"record_touches": True}, {}),
    "no warm-up": ({}, {"warmup_steps": 0, "window_steps": 400}),
    "odd clocks": (
        {"record_touches": True, "proximity_steps": 7},
        {"warmup_steps": 130, "window_steps": 330, "pose_steps": 33},
    ),
    "rare poses": ({}, {"pose_steps": 700, "window_steps": 700, "warmup_steps": 0}),
}


@pytest.mark.parametrize(("arena", "simulation"), CASES.values(), ids=CASES)
def test_honest_advances_are_taken(
    arena: dict[str, Any], simulation: dict[str, Any]
) -> None:
    rules = settings_of(arena=arena, simulation=simulation)
    poses = matures = touches = 0
    for advance, expected in advances(rules, [25, 200, 333, 500, 1000, 1400]):
        poses += check(advance, expected)
        matures += sum(one.is_mature for one in advance.judgements)
        touches += len(advance.touches)
    assert poses > 0
    assert (matures > 0) == (rules.simulation.window_steps < 1000)
    assert (touches > 0) == bool(arena.get("record_touches"))


def test_robots_that_diverge_are_taken() -> None:
    """They fall faster than any robot may move."""
    rules = settings_of(arena={"drop_m": 40.0}, simulation={})
    casualties = 0
    for advance, expected in advances(rules, [200, 400, 700, 900]):
        check(advance, expected)
        casualties += len(advance.casualties)
    assert casualties > 0
