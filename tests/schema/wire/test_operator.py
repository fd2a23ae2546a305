"""Operators' requests and replies as bytes."""

from contextlib import suppress

import pytest
from hypothesis import given
from hypothesis import strategies as st

from schema.errors import MalformedMessage
from schema.parts import BUILT_IN
from schema.robot.genome import Node, develop
from schema.robot.ids import BirthId
from schema.wire import revolve_pb2 as pb
from schema.wire.operator import (
    BrainWish,
    InsertWish,
    ListWish,
    OperatorReply,
    OperatorRequest,
    PauseWish,
    RemoveWish,
    ResumeWish,
    SnapshotWish,
    StatusWish,
    Wish,
    decode_operator_reply,
    decode_operator_request,
    encode_operator_reply,
    encode_operator_request,
)
from schema.wire.status import IslandStatus, RunStatus, Status

CORE = develop(Node("Core", -1, 0, (0.5, 0.5, 0.5)), BUILT_IN)


@pytest.mark.parametrize(
    "wish",
    [
        ListWish(),
        PauseWish(),
        ResumeWish(),
        SnapshotWish(),
        StatusWish(),
        InsertWish(CORE),
        InsertWish(CORE, (0.0, -1.5)),
        RemoveWish(BirthId(1, 12)),
        BrainWish(BirthId(0, 3), CORE),
    ],
)
def test_requests_come_back(wish: Wish) -> None:
    request = OperatorRequest("id", 2, wish, "a/run")
    assert decode_operator_request(encode_operator_request(request)) == request


@pytest.mark.parametrize("is_refused", [False, True])
def test_replies_come_back(is_refused: bool) -> None:  # noqa: FBT001 - a case
    reply = OperatorReply("at 5 s", is_refused=is_refused)
    assert decode_operator_reply(encode_operator_reply(reply)) == reply


def test_a_status_comes_back() -> None:
    arena = IslandStatus(7, 50, None, 12, 33.5, is_paused=True)
    island = IslandStatus(15, 15, 0.25, 15)
    runs = (
        RunStatus("/a/b-0", "b", 0, "running", 1.5, (arena, island)),
        RunStatus("/a/b-1", "b", 1, "waiting"),
    )
    reply = OperatorReply("", status=Status(runs, 2, 1, 1.5))
    assert decode_operator_reply(encode_operator_reply(reply)) == reply


def test_time_left_counts_what_is_still_to_be_born() -> None:
    done = RunStatus("c", "c", 0, "finished", 0.0, (IslandStatus(9, 50, 0.1, 3),))
    half = RunStatus("d", "d", 0, "running", 2.0, (IslandStatus(30, 50, 0.1, 3),))
    assert Status((done, half), 1, 1, 2.0).left_s == 10.0
    assert Status((done, half), 0, 1, 0.0).left_s is None
    assert Status((done,), 0, 1, 0.0).left_s == 0.0


def test_a_request_needs_a_name_and_a_wish() -> None:
    nameless = pb.OperatorRequest(pause=pb.Nothing())
    with pytest.raises(MalformedMessage, match="request_id"):
        decode_operator_request(nameless.SerializeToString())
    with pytest.raises(MalformedMessage, match="no wish"):
        decode_operator_request(pb.OperatorRequest(request_id="x").SerializeToString())


def test_a_place_must_be_one() -> None:
    placed = pb.PlacedRobot(has_place=True, x=float("nan"))
    placed.robot.ParseFromString(
        pb.OperatorRequest.FromString(
            encode_operator_request(OperatorRequest("x", 0, InsertWish(CORE)))
        ).insert.robot.SerializeToString()
    )
    message = pb.OperatorRequest(request_id="x", insert=placed)
    with pytest.raises(MalformedMessage, match=r"insert\.x"):
        decode_operator_request(message.SerializeToString())


@given(st.binary(max_size=200))
def test_any_bytes_decode_or_are_refused(data: bytes) -> None:
    for decode in (decode_operator_request, decode_operator_reply):
        with suppress(MalformedMessage):
            decode(data)
