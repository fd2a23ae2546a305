"""Mutated requests to a worker and an analyzer: each one gets a reply."""

from collections.abc import Callable

import msgspec
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.strategies import DataObject

import analyzer.report
from schema.agent.network import Agent
from schema.agent.request_handler import Server
from schema.errors import UnexpectedEvent
from schema.experiment.identity import Origin
from schema.experiment.settings import arena_settings, vetting_settings
from schema.limits import LONGEST_REASON, MOST_PARTS
from schema.robot.ids import BirthId
from schema.wire import revolve_pb2 as pb
from schema.wire.arena import Advance, Changes, Insertion, Rebuild
from schema.wire.arena_codec import AdvanceRequest, encode_advance_request
from schema.wire.codec import encode_body, encode_request
from tests.coordinator.arena_world import experiment
from tests.coordinator.sent_requests import ROBOT
from tests.worker.fake_world import FakeWorld
from worker.serve.shards import Shards

EXPERIMENT = experiment(9)
LAST = 10_000
VETTING = encode_request(
    run="r",
    epoch=1,
    number=2,
    settings=vetting_settings(EXPERIMENT),
    robot=encode_body(ROBOT),
)
CHANGES = Changes((), (Insertion(BirthId(0, 0), ROBOT, (0.0, 0.0)),))
ADVANCE = encode_advance_request(
    AdvanceRequest(
        run="r",
        epoch=1,
        number=3,
        settings=arena_settings(EXPERIMENT, Origin()),
        shard=0,
        from_step=0,
        from_digest=b"",
        changes=CHANGES,
        until=1000,
        wants_snapshot=True,
        rebuild=Rebuild(b"", (), (BirthId(0, 0),)),
    )
)


def server(compute: Callable[[bytes], bytes]) -> Server:
    return Server(compute, Agent("worker", "w", "tcp/h:1"))


class NearWorld(FakeWorld):
    """World that is never advanced far, whatever a mutated request says."""

    def advance(self, until: int) -> Advance:
        if until > LAST:
            raise UnexpectedEvent("too far")
        return super().advance(until)


def advancing(data: bytes) -> bytes:
    return Shards(NearWorld).answer(data)


@pytest.mark.parametrize(
    ("compute", "valid"),
    [(analyzer.report.answer, VETTING), (advancing, ADVANCE)],
    ids=["vetting", "advance"],
)
@settings(deadline=None)
@given(data=st.data())
def test_mutated_requests_get_a_reply(
    compute: Callable[[bytes], bytes], valid: bytes, data: DataObject
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
    message = pb.Request.FromString(VETTING)
    message.robot = b"\x0a\x00" * (MOST_PARTS + 1)
    made = server(analyzer.report.answer)
    reply = made.reply(message.SerializeToString())
    assert reply.reason == "Robot.parts: must be <= 1000, got 1001"
    assert made.counts.malformed == 1


def test_settings_of_the_wrong_type_are_refused() -> None:
    message = pb.Request.FromString(VETTING)
    message.settings = msgspec.json.encode({"space": "x" * 100_000})
    reply = server(analyzer.report.answer).reply(message.SerializeToString())
    assert "settings of a request" in reply.reason


def test_settings_that_are_not_utf_8_are_refused() -> None:
    message = pb.Request.FromString(VETTING)
    message.settings = b'{"space": "\xff"}'
    reply = server(analyzer.report.answer).reply(message.SerializeToString())
    assert "settings of a request" in reply.reason
