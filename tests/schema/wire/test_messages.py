"""All messages of MessagePack: round trips, damaged bytes, limits, and their cost."""

import json
import math
import subprocess
import sys
from contextlib import suppress
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.strategies import DataObject
from msgspec import msgpack

from coordinator.islands.events import JournalledEvent
from schema.errors import MalformedMessage
from schema.limits import ANSWER_BYTES, LONGEST_REASON, MOST_EPOCH, UPDATE_BYTES
from schema.robot.ids import BirthId
from schema.robot.results import Evaluation
from schema.robot.robot import Part, Robot
from schema.wire.arena import (
    Advance,
    AdvanceShard,
    Casualty,
    Changes,
    Insertion,
    Judgement,
    Live,
    Touch,
)
from schema.wire.codec import decode, encode, fingerprint, format_digest
from schema.wire.messages import (
    OF_AGENTS,
    AgentInfo,
    Answer,
    Bred,
    Call,
    Evaluate,
    Newborn,
    Request,
    Result,
    Work,
)
from schema.wire.operator import (
    InsertRobot,
    OperatorReply,
    OperatorRequest,
    RemoveRobot,
)
from schema.wire.status import Status
from schema.wire.updates import Page, Update
from tests.schema.wire.bombs import DECODED, REFUSED
from tests.schema.wire.message_examples import messages_of

KINDS: dict[str, Any] = {
    **{kind.__name__: kind for kind in OF_AGENTS},
    "Live": Live,
    "OperatorRequest": OperatorRequest,
    "OperatorReply": OperatorReply,
    "Update": Update,
    "Page": Page,
    "JournalledEvent": JournalledEvent,
}
EXAMPLES = {name: messages_of(kind) for name, kind in KINDS.items()}
MOST = UPDATE_BYTES
BIRTH = BirthId(0, 3)
ROBOT = Robot((Part("Core", -1, -1, -1, 0, (0.5,)),))
JUDGEMENT = Judgement(BIRTH, 15.0, 0.1, 0.0, 0.1, True, (0.0, 0.0, 0.02), (0.5,))
ADVANCE = Advance(
    1000,
    bytes(32),
    (JUDGEMENT,),
    (Casualty(BIRTH, 7, "fell", (0.0, 0.0, 0.0)),),
    (Touch(BIRTH, BirthId(0, 4), 0.1),),
)
BRED = Bred(BIRTH, 0, ("no motor",), Newborn(b"genome", ROBOT, 3))
COMMANDED = OperatorRequest("id", 2, InsertRobot(ROBOT, (0.0, -1.5)), "run")


def request(work: Work) -> Request:
    return Request("run", 1, 2, work, b"{}")


def answer(result: Result) -> Answer:
    return Answer(1, 2, 0.5, result)


EVALUATED = answer(Evaluation(0.25, 0.06, 0.05, 12.0, (1.0,)))
EVALUATE = request(Evaluate(BIRTH, ROBOT))
SHARD = request(
    AdvanceShard(0, 1, 400, Changes((BIRTH,), (Insertion(BIRTH, ROBOT, (0, 1)),)), True)
)


@pytest.mark.parametrize("name", KINDS)
@settings(max_examples=30)
@given(data=st.data())
def test_round_trip(name: str, data: DataObject) -> None:
    message = data.draw(EXAMPLES[name])
    encoded = encode(message)
    decoded = decode(KINDS[name], encoded, MOST)
    # Unlike equality, the text tells -0.0 from 0.0, and a float from a whole number.
    assert repr(decoded) == repr(message)
    assert encode(decoded) == encoded


@pytest.mark.parametrize("name", KINDS)
@settings(max_examples=30)
@given(data=st.data())
def test_damaged_bytes_decode_or_are_malformed(name: str, data: DataObject) -> None:
    sound = encode(data.draw(EXAMPLES[name]))
    place = data.draw(st.integers(0, len(sound) - 1))
    byte = bytes([data.draw(st.integers(0, 255))])
    cut = data.draw(st.sampled_from([place + 1, len(sound)]))
    with suppress(MalformedMessage):
        decoded = decode(
            KINDS[name], sound[:place] + byte + sound[place + 1 : cut], MOST
        )
        assert repr(decode(KINDS[name], encode(decoded), MOST)) == repr(decoded)


def changed(message: object, path: str, value: object) -> bytes:
    """Return the bytes of a message with another value at a path of names."""
    tree = msgpack.decode(encode(message))
    *way, last = [int(step) if step.isdigit() else step for step in path.split(".")]
    place: Any = tree
    for step in way:
        place = place[step]
    place[last] = value
    return msgpack.encode(tree)


@pytest.mark.parametrize("number", [math.nan, math.inf, -math.inf])
@pytest.mark.parametrize(
    ("message", "path"),
    [
        (EVALUATED, "wall_s"),
        (EVALUATED, "result.fitness"),
        (EVALUATED, "result.simulated_s"),
        (EVALUATED, "result.measures.0"),
        (answer(BRED), "result.child.robot.0.0.5.0"),
        (answer(ADVANCE), "result.judgements.0.1"),
        (answer(ADVANCE), "result.judgements.0.4"),
        (answer(ADVANCE), "result.judgements.0.7.0"),
        (answer(ADVANCE), "result.casualties.0.3.2"),
        (answer(ADVANCE), "result.touches.0.2"),
        (EVALUATE, "work.robot.0.0.5.0"),
        (SHARD, "work.changes.insertions.0.place.1"),
        (SHARD, "work.changes.insertions.0.heading"),
        (COMMANDED, "action.place.1"),
        (OperatorReply("", status=Status((), 0, 0, 0.5)), "status.births_per_s"),
    ],
)
def test_numbers_are_finite(message: object, path: str, number: float) -> None:
    decode(type(message), changed(message, path, 0.5), MOST)
    with pytest.raises(MalformedMessage):
        decode(type(message), changed(message, path, number), MOST)


@pytest.mark.parametrize(
    ("message", "path", "value", "why"),
    [
        (EVALUATE, "epoch", MOST_EPOCH + 1, "<= 4294967296"),
        (EVALUATE, "number", -1, ">= 0"),
        (EVALUATE, "run", "x" * 5001, "length <= 5000"),
        (EVALUATE, "run", "", "length >= 1"),
        (EVALUATE, "work.birth", [2**32, 0], "<= 4294967295"),
        (EVALUATE, "work.birth", [0, -1], ">= 0"),
        (EVALUATE, "work.robot", [], "at least length 1"),
        (EVALUATE, "work.type", "explode", "explode"),
        (EVALUATE, "more", 1, "unknown field `more`"),
        (EVALUATED, "wall_s", -1.0, ">= 0"),
        (EVALUATED, "result", {}, "type"),
        (EVALUATED, "result", None, "object"),
        (answer(ADVANCE), "result.digest", b"short", "32"),
        (answer(BRED), "result.child.robot", [], "at least length 1"),
        (answer(BRED), "result.child.connections", -1, ">= 0"),
        (COMMANDED, "request_id", "", "length >= 1"),
        (COMMANDED, "island", 2**32, "island"),
        (COMMANDED, "action", {"type": "pause", "island": 1}, "unknown field"),
        (COMMANDED, "version", 2, "another version of Revolve Islands"),
        (Page(b""), "page", -1, ">= 0"),
        (Page(b""), "pages", 10**6, "<= 2048"),
        (AgentInfo("w", "worker", 1, "p", "1"), "slots", 0, ">= 1"),
        (AgentInfo("w", "worker", 1, "p", "1"), "deaths", [{}] * 9, "length <= 8"),
    ],
)
def test_values_out_of_range_are_malformed(
    message: object, path: str, value: object, why: str
) -> None:
    with pytest.raises(MalformedMessage, match=why):
        decode(type(message), changed(message, path, value), MOST)


@pytest.mark.parametrize("nest", [b"\x91", b"\x81\xa1a"])
def test_nested_lists_are_malformed(nest: bytes) -> None:
    nested = nest * 100_000 + b"\xc0"
    unknown = encode(COMMANDED)
    unknown = bytes([unknown[0] + 1]) + b"\xa1x" + nested + unknown[1:]
    for kind in KINDS.values():
        for data in (nested, unknown):
            with pytest.raises(MalformedMessage):
                decode(kind, data, MOST)
    part = encode(ROBOT.parts[0])
    longer = bytes([part[0] + 1]) + part[1:] + nested
    assert part in encode(EVALUATE)
    with pytest.raises(MalformedMessage, match="at most length 7"):
        decode(Request, encode(EVALUATE).replace(part, longer), MOST)


def test_a_message_of_too_many_bytes_is_not_read() -> None:
    with pytest.raises(MalformedMessage) as raised:
        decode(Answer, bytes(ANSWER_BYTES + 1), ANSWER_BYTES)
    assert raised.value.kind == "too large"


def test_the_longest_reason_fits_an_answer() -> None:
    assert 4 * LONGEST_REASON < ANSWER_BYTES


def test_a_fingerprint_identifies_a_request() -> None:
    prints = {fingerprint(encode(each)) for each in (EVALUATE, SHARD, EVALUATE)}
    assert [len(each) for each in prints] == [8, 8]


def test_the_digest_of_formats_changes_with_fields_and_limits() -> None:
    kinds = (Request, Answer, AgentInfo, RemoveRobot, Evaluate, Call)
    digests = {format_digest(kind) for kind in kinds}
    assert len(digests) == len(kinds)
    assert format_digest(Request) in digests


def cost(name: str, size: int) -> dict[str, Any]:
    """Return what a message takes in a process of its own."""
    done = subprocess.run(
        [sys.executable, "-m", "tests.schema.wire.bombs", name, str(size)],
        capture_output=True,
        text=True,
        check=True,
    )
    found: dict[str, Any] = json.loads(done.stdout)
    return found


@pytest.mark.parametrize("name", REFUSED)
def test_a_bomb_of_40_mb_is_refused_at_once(name: str) -> None:
    """Decoded, its lists would take gigabytes."""
    found = cost(name, 40_000_000)
    assert found["error"]
    assert found["bytes"] > 39_000_000
    assert found["grown"] < 10_000_000
    assert found["used_s"] < 2.5


@pytest.mark.parametrize("name", DECODED)
def test_a_message_takes_at_most_some_fifty_times_its_bytes(name: str) -> None:
    found = cost(name, 8_000_000)
    assert found["error"] == ""
    assert found["bytes"] > 7_000_000
    assert found["grown"] < 60 * found["bytes"]
    assert found["used_s"] < 20.0
