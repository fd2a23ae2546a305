"""Values of calls and poses travel unchanged."""

from datetime import date

import numpy as np
import pytest
from msgspec.structs import replace

from schema.errors import ExperimentError, MalformedMessage
from schema.limits import VALUE_BYTES
from schema.robot.ids import BirthId
from schema.tables.columns import ROWS
from schema.wire.arena import NO_POSES, Poses
from schema.wire.calls import pack_value, unpack_value
from schema.wire.codec import decode, encode
from schema.wire.poses import PoseArrays


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


SENT = PoseArrays(
    islands=np.array([0, 2], np.int32),
    births=np.array([7, 2**40], np.int64),
    times_s=np.array([0.2, 0.4]),
    cores=np.arange(14, dtype=np.float32).reshape(2, 7),
    joints=np.array([0, 3], np.int32),
    angles=np.array([0.5, -0.25, 1.5], np.float32),
)


def test_poses_travel_unchanged() -> None:
    message = decode(Poses, encode(SENT.message()), 1000)
    received = PoseArrays.received(message)
    for name in PoseArrays._fields:
        assert np.array_equal(getattr(received, name), getattr(SENT, name))
    assert received.robots == [BirthId(0, 7), BirthId(2, 2**40)]


def test_rows_of_an_arena_name_the_islands_of_immigrants() -> None:
    rows = SENT.rows(island=0)
    assert rows.schema == ROWS["poses"]
    first = {"island": 0, "birth_island": None, "birth": 7, "sim_time_s": 0.2}
    places = dict(zip(("x", "y", "z", "qw", "qx", "qy", "qz"), range(7), strict=True))
    assert rows.slice(0, 1).to_pylist() == [{**first, **places, "angles": []}]
    assert rows["island"].to_pylist() == [0, 0]
    assert rows["birth_island"].to_pylist() == [None, 2]
    assert rows["angles"][1].as_py() == [0.5, -0.25, 1.5]
    assert SENT.rows()["island"].to_pylist() == [0, 2]
    assert SENT.rows()["birth_island"].null_count == 2


def test_no_poses_are_no_rows() -> None:
    table = PoseArrays.received(NO_POSES).rows(island=1)
    assert table.num_rows == 0
    assert table.schema == ROWS["poses"]


@pytest.mark.parametrize(
    "forged",
    [
        {"islands": b""},
        {"births": b"\0" * 15},
        {"times_s": b"\0" * 8},
        {"cores": b"\0" * 28},
        {"cores": b"\0" * 32},
        {"joints": np.array([0, 2], "<i4").tobytes()},
        {"joints": np.array([-1, 4], "<i4").tobytes()},
        {"joints": np.array([2**31 - 1, 2**31 - 1], "<i4").tobytes()},
        {"angles": b""},
    ],
    ids=str,
)
def test_columns_of_different_lengths_are_refused(forged: dict[str, bytes]) -> None:
    with pytest.raises(MalformedMessage, match="poses: "):
        PoseArrays.received(replace(SENT.message(), **forged))
