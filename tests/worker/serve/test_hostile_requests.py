"""Mutated requests to a worker and an analyzer: each one gets a reply."""

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.strategies import DataObject
from msgspec.structs import replace

import tests.analyzers
from schema.agent.network import Agent
from schema.agent.request_handler import Compute, Server
from schema.errors import UnexpectedEvent
from schema.experiment.identity import Origin
from schema.experiment.settings import arena_settings, breeding_settings
from schema.limits import LONGEST_REASON, MOST_PARTS
from schema.parts import BUILT_IN
from schema.robot.genome import Node, develop
from schema.robot.ids import BirthId
from schema.robot.robot import Robot
from schema.wire.arena import Advance, AdvanceShard, Changes, Insertion, Rebuild
from schema.wire.codec import encode
from schema.wire.messages import Breed, Evaluate, Request, Result
from tests.coordinator.arena_world import experiment
from tests.worker.fake_world import FakeWorld
from worker.serve.jobs import Jobs
from worker.serve.shards import Shards

EXPERIMENT = experiment(9)
LAST = 10_000
BIRTH = BirthId(0, 0)
ROBOT = develop(Node("Core", -1, 0, (0.5, 0.5, 0.5)), BUILT_IN)
BREEDING = Request("r", 1, 2, Breed(BIRTH, 0, 5), breeding_settings(EXPERIMENT))
ADVANCE = Request(
    "r",
    1,
    3,
    AdvanceShard(
        0,
        0,
        1000,
        Changes((), (Insertion(BIRTH, ROBOT, (0.0, 0.0)),)),
        wants_snapshot=True,
        rebuild=Rebuild(b"", (), (BIRTH,)),
    ),
    arena_settings(EXPERIMENT, Origin()),
)


def server(compute: Compute) -> Server:
    return Server(compute, Agent("worker", "w", "tcp/h:1"))


class NearWorld(FakeWorld):
    """World that is never advanced far, whatever a mutated request says."""

    def advance(self, until: int, **ways: object) -> Advance:
        if until > LAST:
            raise UnexpectedEvent("too far")
        return super().advance(until, **ways)


def working(request: Request) -> Result:
    return Jobs(Shards(NearWorld)).answer(request)


@pytest.mark.parametrize(
    ("compute", "valid"),
    [(tests.analyzers.answer, encode(BREEDING)), (working, encode(ADVANCE))],
    ids=["breeding", "advance"],
)
@settings(deadline=None)
@given(data=st.data())
def test_mutated_requests_get_a_reply(
    compute: Compute, valid: bytes, data: DataObject
) -> None:
    assert server(compute).reply(valid).answer
    mutated = bytearray(valid)
    for _ in range(data.draw(st.integers(1, 4))):
        place = data.draw(st.integers(0, len(mutated) - 1))
        mutated[place] = data.draw(st.integers(0, 255))
    del mutated[data.draw(st.integers(0, 2 * len(mutated))) :]
    reply = server(compute).reply(bytes(mutated))
    assert bool(reply.answer) != bool(reply.reason)
    assert len(reply.reason) <= LONGEST_REASON


def test_a_robot_of_too_many_parts_is_refused() -> None:
    parts = ROBOT.parts * (MOST_PARTS + 1)
    made = server(working)
    evaluation = replace(ADVANCE, work=Evaluate(BIRTH, Robot(parts)))
    assert "length <= 1000 - at `$.work.robot" in made.reply(encode(evaluation)).reason
    assert made.counts.malformed == 1


@pytest.mark.parametrize(
    "sent", [msgspec.json.encode({"space": "x" * 100_000}), b'{"space": "\xff"}']
)
def test_settings_that_are_none_are_refused(sent: bytes) -> None:
    """Of the wrong type, and not UTF-8."""
    for compute, request in ((tests.analyzers.answer, BREEDING), (working, ADVANCE)):
        reply = server(compute).reply(encode(replace(request, settings=sent)))
        assert "settings of a request" in reply.reason
