"""Operator requests and replies as bytes."""

from contextlib import suppress
from typing import Any

import msgspec
import pytest
from hypothesis import given
from hypothesis import strategies as st

from schema.errors import MalformedMessage
from schema.parts import BUILT_IN
from schema.robot.genome import Node, develop
from schema.robot.ids import BirthId
from schema.wire.operator import (
    GetStatus,
    InsertRobot,
    ListRobots,
    OperatorAction,
    OperatorReply,
    OperatorRequest,
    PauseArena,
    RemoveRobot,
    ResumeArena,
    SaveSnapshot,
    SetBrain,
    decode_operator_reply,
    decode_operator_request,
    encode_operator_reply,
    encode_operator_request,
)
from schema.wire.protobuf import encode_robot
from schema.wire.status import IslandStatus, RunStatus, Status

CORE = encode_robot(develop(Node("Core", -1, 0, (0.5, 0.5, 0.5)), BUILT_IN))
ARENA = IslandStatus(7, 50, None, 12, 33.5, is_paused=True)
ISLAND = IslandStatus(15, 15, 0.25, 15)
RUNS = (
    RunStatus("/a/b-0", "b", 0, "running", 1.5, (ARENA, ISLAND)),
    RunStatus("/a/b-1", "b", 1, "waiting"),
)
STATUS = OperatorReply("", status=Status(RUNS, 2, 1, 1.5))


@pytest.mark.parametrize(
    "action",
    [
        ListRobots(),
        PauseArena(),
        ResumeArena(),
        SaveSnapshot(),
        GetStatus(),
        InsertRobot(CORE),
        InsertRobot(CORE, (0.0, -1.5)),
        RemoveRobot(BirthId(2**32 - 1, 2**64 - 1)),
        SetBrain(BirthId(0, 3), CORE),
    ],
)
def test_decoding_inverts_encoding_of_requests(action: OperatorAction) -> None:
    request = OperatorRequest("id", 2, action, "a/run")
    assert decode_operator_request(encode_operator_request(request)) == request


@pytest.mark.parametrize(
    "reply",
    [OperatorReply("at 5 s"), OperatorReply("no arena", is_refused=True), STATUS],
)
def test_decoding_inverts_encoding_of_replies(reply: OperatorReply) -> None:
    assert decode_operator_reply(encode_operator_reply(reply)) == reply


def test_text_of_a_reply_cannot_control_a_terminal() -> None:
    reply = OperatorReply("birth  rank\n\x1b[2J    1\x9b\u202e")
    text = decode_operator_reply(encode_operator_reply(reply)).text
    assert text == "birth  rank\n?[2J    1??"


def test_time_left_counts_what_is_still_to_be_born() -> None:
    done = RunStatus("c", "c", 0, "finished", 0.0, (IslandStatus(9, 50, 0.1, 3),))
    half = RunStatus("d", "d", 0, "running", 2.0, (IslandStatus(30, 50, 0.1, 3),))
    assert Status((done, half), 1, 1, 2.0).left_s == 10.0
    assert Status((done, half), 0, 1, 0.0).left_s is None
    # A slow run beside a fast one: 20 births at 0.5/s.
    slow = RunStatus("e", "e", 0, "running", 0.5, half.islands)
    assert Status((half, slow), 1, 1, 2.5).left_s == 40.0
    assert Status((done,), 0, 1, 0.0).left_s == 0.0


def test_time_left_is_unknown_while_an_arena_is_paused() -> None:
    islands = (IslandStatus(30, 50, 0.1, 3), IslandStatus(9, 50, 0.1, 3, 8.0, True))
    paused = RunStatus("d", "d", 0, "running", 2.0, islands)
    other = RunStatus("e", "e", 0, "running", 2.0, islands[:1])
    assert paused.left_s is None
    assert Status((other, paused), 1, 1, 4.0).left_s is None
    assert Status((other,), 1, 1, 4.0).left_s == 10.0


@pytest.mark.parametrize(
    ("change", "why"),
    [
        ({"request_id": ""}, "request_id"),
        ({"action": {}}, "action"),
        ({"action": {"type": "explode"}}, "explode"),
        ({"action": {"type": "pause", "island": 1}}, "unknown field `island`"),
        ({"island": -1}, "island"),
        ({"island": 2**32}, "island"),
        ({"action": {"type": "remove", "birth": (0, -1)}}, "birth"),
        ({"action": {"type": "insert", "robot": b"\xff"}}, "Robot"),
        ({"action": {"type": "brain", "birth": (0, 1), "robot": b""}}, "core"),
        ({"action": {"type": "insert", "robot": CORE, "place": (0.0, 1e999)}}, "place"),
        (
            {"action": {"type": "insert", "robot": CORE, "place": (1e999 * 0, 0.0)}},
            "place",
        ),
        ({"version": 2}, "version of Revolve Islands"),
    ],
)
def test_requests_that_break_a_rule_are_malformed(
    change: dict[str, Any], why: str
) -> None:
    request = {"request_id": "x", "island": 0, "action": {"type": "pause"}}
    decode_operator_request(msgspec.msgpack.encode(request))
    with pytest.raises(MalformedMessage, match=why):
        decode_operator_request(msgspec.msgpack.encode(request | change))


@pytest.mark.parametrize("number", [float("nan"), float("inf"), -float("inf")])
def test_status_with_a_number_that_is_not_finite_is_malformed(number: float) -> None:
    reply = OperatorReply("", status=Status((), 0, 0, number))
    with pytest.raises(MalformedMessage, match="births_per_s"):
        decode_operator_reply(encode_operator_reply(reply))


@given(st.binary(max_size=200))
def test_any_bytes_decode_or_are_malformed(data: bytes) -> None:
    for decode in (decode_operator_request, decode_operator_reply):
        with suppress(MalformedMessage):
            decode(data)


@given(st.integers(0, 10**4), st.integers(0, 255))
def test_messages_with_one_other_byte_decode_or_are_malformed(
    index: int, value: int
) -> None:
    request = OperatorRequest("id", 2, InsertRobot(CORE, (0.0, -1.5)), "a/run")
    data = bytearray(encode_operator_request(request))
    data[index % len(data)] = value
    with suppress(MalformedMessage):
        decode_operator_request(bytes(data))
    data = bytearray(encode_operator_reply(STATUS))
    data[index % len(data)] = value
    with suppress(MalformedMessage):
        decode_operator_reply(bytes(data))


@pytest.mark.parametrize("nest", [b"\x91", b"\x81\xa1a"])
def test_nested_lists_are_malformed(nest: bytes) -> None:
    """The decoder skips what it does not know, to any depth that it can."""
    whole = encode_operator_request(OperatorRequest("id", 0, GetStatus()))
    nested = bytes([whole[0] + 1]) + b"\xa1x" + nest * 100_000 + b"\xc0" + whole[1:]
    for data in (nested, nest * 100_000 + b"\xc0"):
        with pytest.raises(MalformedMessage):
            decode_operator_request(data)
        with pytest.raises(MalformedMessage):
            decode_operator_reply(data)
