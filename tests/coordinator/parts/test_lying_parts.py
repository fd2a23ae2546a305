"""Answers of workers that lie about their part are refused, each in one line."""

from collections.abc import Callable
from dataclasses import dataclass

import pytest
from msgspec import json
from msgspec.structs import replace

from coordinator.parts.arena_parts import ArenaParts
from coordinator.run.advance_checks import ExpectedAdvance
from coordinator.run.shard_answers import PartReached, read_part
from schema.errors import MalformedMessage
from schema.experiment.settings import read_arena_settings
from schema.limits import ADVANCE_BYTES
from schema.robot.ids import BirthId
from schema.robot.results import Provenance
from schema.wire.arena import Advance, AdvanceShard, Casualty, Changes
from schema.wire.arena_state import ArenaState
from schema.wire.codec import decode, encode
from schema.wire.messages import Answer, Request, StateMissing
from tests.worker.arena_cases import EXPERIMENT, crowd, populated, settings_of
from tests.worker.conftest import random_robot
from worker.arena.world import World
from worker.serve.shards import Shards

SETTINGS = read_arena_settings(json.encode(settings_of()))
FIRST = BirthId(0, 0)


@dataclass
class Honest:
    """An honest answer of the only part of an arena, and what reads it."""

    expected: ExpectedAdvance
    advance: Advance

    def read(self, advance: Advance | StateMissing) -> PartReached | None:
        return read_part(
            encode(Answer(0, 1, 0.5, advance)),
            job=(0, 1),
            is_whole=True,
            expected=self.expected,
            provenance=Provenance("w0"),
        )


@pytest.fixture(scope="module")
def honest() -> Honest:
    world = populated(SETTINGS, crowd(random_robot, 3, 1.0))
    arena = ArenaParts(world.state(), 0.04, 200)
    places = {robot.birth: robot.place for robot in world.population.robots}
    arena.begin(AdvanceShard(0, 0, 400, Changes(), False), places, 1)
    work = arena.request(0, is_whole=True)
    data = json.encode(SETTINGS)
    advance = Shards(World).answer(Request("run", 0, 1, work, data), work)
    assert isinstance(advance, Advance)
    expected = ExpectedAdvance(
        0, 200, arena.robots(0), replace(EXPERIMENT, arena=SETTINGS.arena),
        wants_snapshot=False, judges=False,
    )  # fmt: skip
    return Honest(expected, advance)


def with_state(advance: Advance, change: Callable[[ArenaState], ArenaState]) -> Advance:
    """Return an advance with another state, and its digest."""
    state = change(decode(ArenaState, advance.snapshot, ADVANCE_BYTES))
    return replace(advance, snapshot=encode(state), digest=state.digest)


LIES: dict[str, tuple[Callable[[Advance], Advance], str]] = {
    "omits a robot": (
        lambda one: with_state(one, lambda s: replace(s, robots=s.robots[1:])),
        "missing 0/0",
    ),
    "adds a robot": (
        lambda one: with_state(
            one, lambda s: replace(s, robots=(*s.robots, (BirthId(0, 9), b"")))
        ),
        "unknown 0/9",
    ),
    "kills one that it returns": (
        lambda one: replace(
            one, casualties=(Casualty(FIRST, 100, "none", (0.0, 0.0, 0.0)),)
        ),
        "a robot is reported twice",
    ),
    "wrong digest": (
        lambda one: replace(one, digest=bytes(32)),
        "the step and digest of the advance",
    ),
    "wrong step": (
        lambda one: with_state(one, lambda s: replace(s, step=199)),
        "the step and digest of the advance",
    ),
    "casualties of its own": (
        lambda one: with_state(
            one,
            lambda s: replace(s, casualties=(Casualty(FIRST, 1, "", (0.0, 0.0, 0.0)),)),
        ),
        "casualties must be reported",
    ),
    "too few boxes": (
        lambda one: replace(one, boxes=one.boxes[1:]),
        "must have 3 boxes and costs, got [2, 3]",
    ),
    "moves a robot": (
        lambda one: replace(
            one, boxes=(tuple(9.0 + side for side in one.boxes[0]), *one.boxes[1:])
        ),
        "robot 0:0 must be in the box that it swept",
    ),
    "no state": (lambda one: replace(one, snapshot=b""), "Input data was truncated"),
}


def test_an_honest_answer_is_taken(honest: Honest) -> None:
    reached = honest.read(honest.advance)
    assert reached is not None
    assert sorted(reached.result.boxes) == sorted(honest.expected.living)
    assert reached.provenance == Provenance("w0", "", 0.5)


@pytest.mark.parametrize(("lie", "why"), LIES.values(), ids=LIES)
def test_a_lie_is_refused(
    honest: Honest, lie: Callable[[Advance], Advance], why: str
) -> None:
    with pytest.raises(MalformedMessage) as error:
        honest.read(lie(honest.advance))
    assert why in str(error.value)
    assert "\n" not in str(error.value)


def test_a_state_that_came_with_the_request_is_not_missing(honest: Honest) -> None:
    with pytest.raises(MalformedMessage, match="lacks the state that came"):
        honest.read(StateMissing())
