"""Messages of hostile size: what they cost before they are refused."""

import subprocess
import sys
from collections.abc import Callable

import pytest

from schema.errors import MalformedMessage
from schema.limits import (
    ANSWER_BYTES,
    LONGEST_REASON,
    MOST_CONNECTIONS,
    MOST_NEURONS,
    MOST_PARTS,
    MOST_SUBMESSAGES,
    printable,
)
from schema.wire import revolve_pb2 as pb
from schema.wire.arena_codec import (
    decode_advance_answer,
    decode_advance_request,
    decode_live,
)
from schema.wire.codec import decode_answer, decode_request
from schema.wire.decoding import parsed
from schema.wire.operator import decode_operator_request
from schema.wire.protobuf import decode_genome, decode_robot
from schema.wire.updates import decode_update

EMPTY_PART = b"\x0a\x00"
"""Field 1, an empty message."""
CORE = pb.Robot(
    parts=[pb.Part(kind="Core", parent=-1, parent_slot=-1, slot=-1)]
).SerializeToString()
HEAD_40_MB = b"\x80\xb4\x89\x13"
"""Length of a field of 40 MB."""

BOMBS: dict[str, tuple[Callable[[bytes], object], bytes]] = {
    "parts": (decode_robot, EMPTY_PART * (MOST_PARTS + 1)),
    "nodes": (decode_genome, EMPTY_PART * (MOST_PARTS + 1)),
    "neurons": (decode_robot, CORE + b"\x12\x00" * (MOST_NEURONS + 1)),
    "connections": (decode_robot, CORE + b"\x1a\x00" * (MOST_CONNECTIONS + 1)),
    "robot": (decode_robot, EMPTY_PART * 1_000_000),
    "request": (decode_request, b"\x0a\x7f" * 10_000_000),
    "answer": (decode_answer, pb.Answer(failure="x" * 10_000_000).SerializeToString()),
    "intersections": (
        lambda data: decode_answer(data, 3),
        pb.Answer(report=pb.Report(intersections=[pb.Intersection()] * 4))
        .SerializeToString(),
    ),
    "casualties": (
        decode_advance_answer,
        b"\x22" + HEAD_40_MB + b"\x22\x00" * 20_000_000,
    ),
    "live": (decode_live, bytes(65 * 2**20)),
    "removals": (
        decode_advance_request,
        b"\x42" + HEAD_40_MB + EMPTY_PART * 20_000_000,
    ),
    "order": (decode_operator_request, bytes(3 * 2**20)),
    "update": (decode_update, bytes(65 * 2**20)),
}  # fmt: skip


@pytest.mark.parametrize(("decode", "bomb"), BOMBS.values(), ids=BOMBS)
def test_bombs_are_too_large(decode: Callable[[bytes], object], bomb: bytes) -> None:
    with pytest.raises(MalformedMessage) as raised:
        decode(bomb)
    assert raised.value.kind == "too large"


@pytest.mark.parametrize(
    ("name", "data"),
    [
        ("decode_advance_answer", "b'\\x22' + head + b'\\x22\\0' * 20_000_000"),
        ("decode_advance_request", "b'\\x42' + head + b'\\x0a\\0' * 20_000_000"),
        ("decode_advance_request", "b'\\x8a\\x01\\0' * 13_000_000"),
    ],
    ids=["casualties", "removals", "living"],
)
def test_a_bomb_of_40_mb_costs_little(name: str, data: str) -> None:
    """Parsed, its submessages would take some gigabytes."""
    program = f"""
import resource, time
from schema.errors import MalformedMessage
from schema.wire.arena_codec import {name}
head = {HEAD_40_MB!r}
data = {data}
peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
start = time.process_time()
try:
    {name}(data)
except MalformedMessage as error:
    assert error.kind == "too large", error
    used_s = time.process_time() - start
    print(resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - peak, used_s)
"""
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    grown_kib, used_s = map(float, done.stdout.split())
    assert grown_kib < 100 * 1024
    assert used_s < 3.0


def test_as_many_submessages_as_allowed_are_parsed() -> None:
    message = pb.Changes(removals=[pb.BirthName(number=7)] * 300_000)
    data = message.SerializeToString()
    assert len(data) > 2**20
    assert len(parsed(data, pb.Changes(), len(data)).removals) == 300_000
    twice = data + data
    assert MOST_SUBMESSAGES < 600_000
    with pytest.raises(MalformedMessage, match="submessages"):
        parsed(twice, pb.Changes(), len(twice))


@pytest.mark.parametrize(
    "end",
    [b"\x0a\x7f", b"\x0a\xff\xff\xff\xff\x0f", b"\x09\0", b"\x0b", b"\xff" * 11],
    ids=["cut off", "long", "cut number", "group", "no number"],
)
def test_large_damaged_messages_are_malformed(end: bytes) -> None:
    """Their fields are counted by our own code."""
    data = pb.AdvanceAnswer(snapshot=bytes(2**21)).SerializeToString()
    with pytest.raises(MalformedMessage):
        parsed(data + end, pb.AdvanceAnswer(), 2**22)
    nested = pb.AdvanceAnswer(snapshot=bytes(2**21)).SerializeToString()
    nested += b"\x22" + bytes([len(end)]) + end
    with pytest.raises(MalformedMessage):
        parsed(nested, pb.AdvanceAnswer(), 2**22)


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("", ""),
        ("plain", "plain"),
        (" two\r\n lines\t", "two lines"),
        ("\x1b[31mred\x1b[0m", "?[31mred?[0m"),
        ("left\u202eright\0", "left?right?"),
        ("Grüße 机器人", "Grüße 机器人"),
        ("x" * 11, "xxxxxxx..."),
        (" " * 1000 + "x", "..."),
    ],
)
def test_texts_become_short_printable_lines(text: str, line: str) -> None:
    assert printable(text, 10 if len(text) > 10 and "x" in text else 40) == line


def test_the_longest_reason_fits_an_answer() -> None:
    assert 4 * LONGEST_REASON < ANSWER_BYTES
