"""Updates of viewers as bytes and from table rows."""

import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from schema.errors import MalformedMessage
from schema.limits import MOST_RUN_NAME, PAGE_BYTES
from schema.robot.ids import BirthId
from schema.robot.robot import Part, Robot
from schema.tables.columns import Row
from schema.wire.codec import encode_body
from schema.wire.updates import (
    Birth,
    Death,
    Level,
    Migrant,
    Page,
    Update,
    WorkerInfo,
    decode_page,
    decode_update,
    encode_update,
    pages_of,
    read_levels,
)

CORE = Robot((Part("Core", -1, -1, -1, 0, (0.1, 0.2, 0.3)),))
UPDATE = Update(
    run="host:/runs/a",
    epoch=3,
    sequence=17,
    is_whole=True,
    experiment="scenario3",
    births=(
        Birth(BirthId(0, 0), (), 1, 1, 0.0, None),
        Birth(
            BirthId(0, 1), (BirthId(0, 0), BirthId(1, 4)), 2, 2, 12.5, encode_body(CORE)
        ),
        Birth(BirthId(1, 4), (), 1, 5, None, encode_body(CORE)),
    ),
    deaths=(Death(0, BirthId(0, 0), 2, 30.0, "cull"),),
    levels=(Level(0, 2, 2, 1, 0.25, 0.25, (BirthId(0, 0), BirthId(0, 1))),),
    migrants=(
        Migrant(BirthId(0, 1), 0, 1, 9, 30, 60.5),
        Migrant(BirthId(0, 0), 1, 0, 2, 15, None),
    ),
    workers=(WorkerInfo("w-1", "x86", (0, 2)), WorkerInfo("w-2", "arm", ())),
    document='{"name": "scenario3"}',
)


def test_decoding_inverts_encoding() -> None:
    assert decode_update(encode_update(UPDATE)) == UPDATE


@given(st.binary(max_size=200))
def test_any_bytes_decode_or_are_malformed(data: bytes) -> None:
    with contextlib.suppress(MalformedMessage):
        decode_update(data)
    with contextlib.suppress(MalformedMessage):
        decode_page(data)


@given(st.integers(0, 10**4), st.integers(0, 255))
def test_updates_with_one_other_byte_decode_or_are_malformed(
    index: int, value: int
) -> None:
    data = bytearray(encode_update(UPDATE))
    data[index % len(data)] = value
    with contextlib.suppress(MalformedMessage):
        decode_update(bytes(data))


def test_a_state_is_cut_into_pages_that_a_connection_sends_at_once() -> None:
    state = replace(UPDATE, run="r" * MOST_RUN_NAME, document="d" * 100_000)
    encoded = pages_of(state)
    assert max(map(len, encoded)) < 1 << 16
    pages = list(map(decode_page, encoded))
    assert [(each.page, each.pages) for each in pages] == [(n, 4) for n in range(4)]
    assert decode_update(b"".join(each.data for each in pages)) == state


@pytest.mark.parametrize(
    "page",
    [Page(b"", pages=10**6), Page(data=bytes(PAGE_BYTES + 1)), Page(b"", page=-1)],
)
def test_pages_of_too_large_a_state_are_malformed(page: Page) -> None:
    with pytest.raises(MalformedMessage):
        decode_page(encode_update(page))


def test_body_that_is_not_a_tree_is_malformed() -> None:
    two_cores = Robot((CORE.parts[0], CORE.parts[0]))
    birth = Birth(BirthId(0, 0), (), 1, 1, None, encode_body(two_cores))
    bad = Update("r", 0, 1, False, "e", (birth,))
    with pytest.raises(MalformedMessage):
        decode_update(encode_update(bad))


def test_level_counts_failed_robots_off_line_and_no_immature_ones_of_arenas() -> None:
    rows: list[Row] = [
        {"island": 0, "births": 2, "birth": 0, "fitness": 0.5},
        {"island": 0, "births": 2, "birth": 1, "fitness": None},
        {"island": 0, "births": 3, "birth": 0, "fitness": 0.25},
        {"island": 0, "births": 3, "birth": 1, "fitness": 0.75},
        {"island": 0, "births": 3, "birth": 2, "fitness": None},
    ]
    two, three = (tuple(BirthId(0, each) for each in range(n)) for n in (2, 3))
    assert read_levels(rows, arenas={0}) == [
        Level(0, 2, 2, 1, 0.5, 0.5, two),
        Level(0, 3, 3, 2, 0.5, 0.75, three),
    ]
    # A failed evaluation counts as 0, as in selection.
    assert read_levels(rows, arenas={1}) == [
        Level(0, 2, 2, 2, 0.25, 0.5, two),
        Level(0, 3, 3, 3, 1 / 3, 0.75, three),
    ]
    # It counts as the least fitness below 0.
    rows[0]["fitness"] = -0.5
    assert read_levels(rows, arenas={1})[0] == Level(0, 2, 2, 2, -0.5, -0.5, two)
