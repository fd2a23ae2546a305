"""Calls of users' functions as bytes."""

from datetime import date

import pytest

from schema.errors import ExperimentError, MalformedMessage
from schema.limits import VALUE_BYTES
from schema.wire import revolve_pb2 as pb
from schema.wire.calls import (
    Call,
    Failed,
    call_settings,
    decode_call_request,
    encode_call_answer,
    encode_call_request,
    pack_value,
    read_call_answer,
    unpack_value,
)
from schema.wire.codec import encode_request, request_kind

CALL = Call(3, 17, "lab:score", {"a": [1, 2.5, None, True, "é", b"\x00"]})


def request(argument: object = CALL.argument) -> bytes:
    return encode_call_request(
        run="run",
        epoch=3,
        number=17,
        settings=call_settings("lab:score"),
        argument=pack_value(argument),
        plugins="lab=123",
    )


def test_call_survives_the_way() -> None:
    assert decode_call_request(request()) == CALL
    # The fields that a supervisor and the check of plug-ins read.
    parsed = pb.Request.FromString(request())
    assert (parsed.run, parsed.epoch, parsed.number) == ("run", 3, 17)
    assert parsed.plugins == "lab=123"


def test_only_a_call_is_a_call() -> None:
    other = encode_request(run="r", epoch=1, number=1, settings=b"{}", robot=b"")
    assert request_kind(request(None)) == "call"
    assert request_kind(other) == "evaluation"
    with pytest.raises(MalformedMessage, match="is no call"):
        decode_call_request(other)
    with pytest.raises(MalformedMessage):
        decode_call_request(request()[:-3])


@pytest.mark.parametrize(
    "value", [7, 2.5, "text", [1, [2]], None, {"a": b"b", "c": [[[True]]]}]
)
def test_value_survives_the_way(value: object) -> None:
    data = encode_call_answer(CALL, 0.5, pack_value(value))
    assert read_call_answer(data, (3, 17)) == value
    with pytest.raises(MalformedMessage, match=r"must be to \(epoch, job\) \(3, 18\)"):
        read_call_answer(data, (3, 18))


def test_failure_is_no_value() -> None:
    data = encode_call_answer(CALL, 0.5, Failed("lab:score raised"))
    assert read_call_answer(data, (3, 17)) == Failed("lab:score raised")
    mute = encode_call_answer(CALL, 0.5, Failed(" "))
    assert read_call_answer(mute, (3, 17)) == Failed("(no message)")
    empty = pb.Answer(epoch=3, number=17).SerializeToString()
    with pytest.raises(MalformedMessage, match="a value or a failure"):
        read_call_answer(empty, (3, 17))


@pytest.mark.parametrize(
    ("value", "why"),
    [
        (object(), "got object"),
        (len, "got builtin_function_or_method"),
        (2**70, "got int"),
        ({1, 2}, "or dict, got set$"),
        ({"a": [1, (frozenset("b"), {"c": {3}})]}, "or dict, got frozenset, set$"),
        ([date(2020, 1, 1)], "got date$"),
        (b"x" * (VALUE_BYTES + 1), f"must have <= {VALUE_BYTES} bytes"),
    ],
)
def test_other_values_are_refused(value: object, why: str) -> None:
    with pytest.raises(ExperimentError, match=why):
        pack_value(value)


def test_bytes_that_are_no_value_are_refused() -> None:
    with pytest.raises(MalformedMessage):
        unpack_value(b"\xc1")
    with pytest.raises(MalformedMessage, match="bytes"):
        unpack_value(b"\xc0" * (VALUE_BYTES + 1))
    with pytest.raises(MalformedMessage):
        unpack_value(b"\x91" * 100_000)
