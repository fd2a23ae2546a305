"""Arena requests and answers: round trips, and decoding of arbitrary bytes."""

import math
from contextlib import suppress
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.strategies import DataObject, SearchStrategy

from schema.errors import MalformedMessage
from schema.limits import LONGEST_REASON, printable
from schema.robot.ids import BirthId
from schema.robot.robot import Robot
from schema.wire import revolve_pb2 as pb
from schema.wire.arena import (
    Advance,
    BrainChange,
    Casualty,
    Changes,
    Insertion,
    Judgement,
    PastAdvance,
    Rebuild,
    Touch,
)
from schema.wire.arena_codec import (
    AdvanceAnswer,
    AdvanceRequest,
    decode_advance_answer,
    decode_advance_request,
    encode_advance_answer,
    encode_advance_request,
)

U64 = st.integers(0, 2**64 - 1)
U32 = st.integers(0, 2**32 - 1)
NUMBER = st.floats(allow_nan=False, allow_infinity=False)
PLACE = st.tuples(NUMBER, NUMBER, NUMBER)
REASON = st.text().map(lambda text: printable(text, LONGEST_REASON)).filter(bool)
BIRTHS = st.builds(BirthId, U32, U64)
DIGEST = st.binary(min_size=32, max_size=32)
SNAPSHOT = st.binary(max_size=40)


def some(things: SearchStrategy[object]) -> SearchStrategy[tuple[object, ...]]:
    return st.lists(things, max_size=3).map(tuple)


JUDGEMENTS = st.builds(
    Judgement,
    BIRTHS,
    NUMBER,
    NUMBER,
    NUMBER,
    NUMBER,
    st.booleans(),
    PLACE,
    some(NUMBER),
)
ADVANCES = st.builds(
    Advance,
    step=U64,
    digest=DIGEST,
    judgements=some(JUDGEMENTS),
    casualties=some(st.builds(Casualty, BIRTHS, U64, REASON, PLACE)),
    touches=some(st.builds(Touch, BIRTHS, BIRTHS, NUMBER)),
    poses=SNAPSHOT,
)
ANSWERS = st.builds(
    AdvanceAnswer, U64, U64, st.floats(0, 1e9), st.none() | ADVANCES, snapshot=SNAPSHOT
)
ZERO = BirthId(0, 0)
JUDGEMENT = Judgement(ZERO, 15.0, 0.1, 0.0, 0.1, is_mature=True, place=(0.0, 0.0, 0.02))
ADVANCE = Advance(1000, bytes(32), (JUDGEMENT,), (), (), b"")
REQUEST = AdvanceRequest(
    run="r", epoch=1, number=2, settings=b"{}", shard=0, from_step=5,
    from_digest=b"", changes=Changes(), until=5, wants_snapshot=False,
)  # fmt: skip


def changes_of(data: DataObject, robots: SearchStrategy[Robot]) -> Changes:
    places = st.tuples(NUMBER, NUMBER)
    insertions = st.builds(Insertion, BIRTHS, robots, places, heading=NUMBER)
    brains = st.builds(
        BrainChange, BIRTHS, robots.map(lambda robot: robot.brain), st.booleans()
    )
    made = st.builds(
        Changes,
        removals=some(BIRTHS),
        insertions=st.lists(insertions, max_size=2).map(tuple),
        brains=st.lists(brains, max_size=2).map(tuple),
    )
    return data.draw(made)


@given(data=st.data())
def test_request_round_trip(robots: SearchStrategy[Robot], data: DataObject) -> None:
    changes = changes_of(data, robots)
    past = st.builds(PastAdvance, st.just(changes), U64, DIGEST)
    living = st.none() | st.lists(BIRTHS, max_size=2).map(tuple)
    pasts = st.lists(past, max_size=2).map(tuple)
    rebuild = st.builds(Rebuild, SNAPSHOT, pasts, living)
    steps = sorted(data.draw(st.tuples(U64, U64)))
    request = AdvanceRequest(
        run=data.draw(st.text()),
        epoch=data.draw(U64),
        number=data.draw(U64),
        settings=data.draw(st.binary()),
        shard=data.draw(U32),
        from_step=steps[0],
        from_digest=data.draw(st.just(b"") | DIGEST),
        changes=changes,
        until=steps[1],
        wants_snapshot=data.draw(st.booleans()),
        rebuild=data.draw(st.none() | rebuild),
    )
    encoded = encode_advance_request(request)
    assert repr(decode_advance_request(encoded)) == repr(request)
    assert encode_advance_request(decode_advance_request(encoded)) == encoded
    # Whoever hands it on knows nothing of arenas.
    job = pb.Request.FromString(encoded)
    asked = (request.run, request.epoch, request.number)
    assert (job.run, job.epoch, job.number) == asked


@given(answer=ANSWERS)
def test_answer_round_trip(answer: AdvanceAnswer) -> None:
    assert repr(decode_advance_answer(encode_advance_answer(answer))) == repr(answer)


def test_a_death_without_reason_says_so() -> None:
    mute = Casualty(BirthId(0, 3), 7, " ", (0.0, 0.0, 0.0))
    advance = Advance(8, b"x" * 32, (), (mute,), (), b"")
    data = encode_advance_answer(AdvanceAnswer(1, 2, 0.5, advance))
    found = decode_advance_answer(data).advance
    assert found is not None
    assert [one.reason for one in found.casualties] == ["(no message)"]


@given(data=st.binary(max_size=64))
def test_any_bytes_decode_or_are_malformed(data: bytes) -> None:
    with suppress(MalformedMessage):
        decode_advance_request(data)
    with suppress(MalformedMessage):
        decode_advance_answer(data)


@given(data=st.data())
def test_damaged_bytes_decode_or_are_malformed(data: DataObject) -> None:
    sound = encode_advance_answer(AdvanceAnswer(1, 2, 0.5, ADVANCE))
    place = data.draw(st.integers(0, len(sound) - 1))
    byte = bytes([data.draw(st.integers(0, 255))])
    damaged = sound[:place] + byte + sound[place + 1 :]
    with suppress(MalformedMessage):
        answer = decode_advance_answer(damaged)
        assert decode_advance_answer(encode_advance_answer(answer)) == answer


@pytest.mark.parametrize(
    "advance",
    [
        replace(ADVANCE, digest=b"short"),
        replace(ADVANCE, judgements=(replace(JUDGEMENT, fitness=math.nan),)),
        replace(ADVANCE, judgements=(replace(JUDGEMENT, age_s=math.inf),)),
        replace(ADVANCE, judgements=(replace(JUDGEMENT, measures=(math.nan,)),)),
        replace(ADVANCE, casualties=(Casualty(ZERO, 1, "", (0, math.nan, 0)),)),
        replace(ADVANCE, touches=(Touch(ZERO, ZERO, -math.inf),)),
    ],
)
def test_advance_that_breaks_a_rule_is_malformed(advance: Advance) -> None:
    with pytest.raises(MalformedMessage):
        decode_advance_answer(encode_advance_answer(AdvanceAnswer(1, 2, 0.5, advance)))


@pytest.mark.parametrize(
    "message", [pb.AdvanceAnswer(epoch=1), pb.AdvanceAnswer(needs_state=False)]
)
def test_answer_without_advance_must_need_the_state(message: pb.AdvanceAnswer) -> None:
    with pytest.raises(MalformedMessage, match="must hold an advance"):
        decode_advance_answer(message.SerializeToString())


def test_rebuild_with_empty_history() -> None:
    request = replace(REQUEST, rebuild=Rebuild(b"", ()))
    assert decode_advance_request(encode_advance_request(request)) == request
    assert decode_advance_request(encode_advance_request(REQUEST)) == REQUEST


def test_end_before_start_is_malformed() -> None:
    with pytest.raises(MalformedMessage, match="until: must be >= from_step = 5"):
        decode_advance_request(encode_advance_request(replace(REQUEST, until=4)))


def test_state_without_is_rebuild_is_malformed() -> None:
    message = pb.AdvanceRequest(snapshot=b"x")
    with pytest.raises(MalformedMessage, match="need is_rebuild"):
        decode_advance_request(message.SerializeToString())
