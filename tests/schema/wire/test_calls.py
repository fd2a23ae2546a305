"""Plain values as bytes: arguments and values of users' functions."""

from datetime import date

import pytest

from schema.errors import ExperimentError, MalformedMessage
from schema.limits import VALUE_BYTES
from schema.wire.calls import pack_value, unpack_value


@pytest.mark.parametrize(
    "value",
    [
        7,
        -2.5,
        "é",
        b"\x00",
        [1, [2]],
        None,
        True,
        {"a": b"b", "c": [[[True]]]},
        {1: {}},
    ],
)
def test_value_survives_the_way(value: object) -> None:
    assert repr(unpack_value(pack_value(value))) == repr(value)
    assert unpack_value(pack_value((1, (value,)))) == [1, [value]]


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


@pytest.mark.parametrize(
    "data",
    [
        b"",
        b"\xc1",
        b"\xc0" * (VALUE_BYTES + 1),
        b"\x91" * 100_000,
        b"\x81\x80\x01",  # a dict as key
    ],
)
def test_bytes_that_are_no_value_are_malformed(data: bytes) -> None:
    with pytest.raises(MalformedMessage):
        unpack_value(data)
