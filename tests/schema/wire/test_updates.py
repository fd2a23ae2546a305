"""Messages to viewers and operators."""

import pytest
from msgspec.structs import replace

from schema.errors import MalformedMessage
from schema.limits import MOST_RUN_NAME, PAGE_BYTES, UPDATE_BYTES
from schema.robot.ids import BirthId
from schema.robot.robot import Part
from schema.tables.columns import Row
from schema.wire.codec import decode, encode
from schema.wire.operator import OperatorReply, decode_operator_reply
from schema.wire.status import IslandStatus, RunStatus, Status
from schema.wire.updates import (
    ArenaSample,
    Birth,
    Level,
    Migrant,
    Page,
    RecordedDeath,
    Update,
    WorkerInfo,
    decode_page,
    pages_of,
    read_levels,
    read_samples,
)

CORE = (Part("Core", -1, -1, -1, 0, (0.1, 0.2, 0.3)),)
UPDATE = Update(
    run="host:/runs/a",
    epoch=3,
    sequence=17,
    is_whole=True,
    experiment="scenario3",
    births=(
        Birth(BirthId(0, 0), (), 1, 1, 0.0, None),
        Birth(BirthId(0, 1), (BirthId(0, 0), BirthId(1, 4)), 2, 2, 12.5, CORE),
        Birth(BirthId(1, 4), (), 1, 5, None, CORE),
    ),
    deaths=(RecordedDeath(0, BirthId(0, 0), 2, 30.0, "cull"),),
    levels=(Level(0, 2, 2, 1, 0.25, 0.25, (BirthId(0, 0), BirthId(0, 1))),),
    migrants=(
        Migrant(BirthId(0, 1), 0, 1, 9, 30, 60.5),
        Migrant(BirthId(0, 0), 1, 0, 2, 15, None),
    ),
    workers=(WorkerInfo("w-1", "x86", (0, 2)), WorkerInfo("w-2", "arm", ())),
    document='{"name": "scenario3"}',
    samples=(ArenaSample(0, 9.0, "energy", ((BirthId(0, 1), 2.0),)),),
)


def test_a_state_is_cut_into_pages_that_a_connection_sends_at_once() -> None:
    state = replace(UPDATE, run="r" * MOST_RUN_NAME, document="d" * 100_000)
    encoded = pages_of(state)
    assert max(map(len, encoded)) < 1 << 16
    pages = list(map(decode_page, encoded))
    assert [(each.page, each.pages) for each in pages] == [(n, 4) for n in range(4)]
    assert decode(Update, b"".join(each.data for each in pages), UPDATE_BYTES) == state


def test_pages_of_too_large_a_state_are_malformed() -> None:
    """Those out of range: tests/schema/wire/test_messages.py."""
    assert decode_page(b"") == Page(b"")
    with pytest.raises(MalformedMessage):
        decode_page(encode(Page(bytes(PAGE_BYTES + 1))))


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
    # A user's function may give any finite number.
    rows = [{**row, "fitness": 1.5e308} for row in rows[:2]]
    assert read_levels(rows, arenas={1}) == [Level(0, 2, 2, 2, 1.5e308, 1.5e308, two)]


def test_samples_of_arenas_gather_rows_of_a_time() -> None:
    robot = {"island": 1, "birth_island": None, "birth": 4, "sim_time_s": 5.0}
    migrant = {**robot, "birth_island": 0}
    other = {"other_island": 1, "other_birth": 7, "over_s": 0.5}
    patch = {"island": 1, "sim_time_s": 5.0, "x": 1.0, "y": 2.0, "radius_m": 0.5}
    two, one = (
        [{"island": 1, "birth": number} for number in n] for n in ((4, 7), (4,))
    )
    mating = {"island": 1, "sim_time_s": 5.0, "parents": two, "birth": 9}
    rows: list[tuple[str, Row]] = [
        ("meetings", {**robot, **other, "sim_time_s": 5.5}),
        ("fitness", {**robot, "stores": [("energy", 3.0), ("rests_until_s", 9.0)]}),
        ("fitness", {**migrant, "stores": [("energy", 4.0), ("rests_until_s", 0.0)]}),
        ("fitness", {**robot, "birth": 5, "stores": None}),
        ("patches", {**patch, "patch": 0, "content": 20.0}),
        ("meetings", {**robot, **other}),
        ("matings", mating),
        ("matings", {**mating, "birth": None}),
        ("matings", {**mating, "parents": one}),
        ("patches", {**patch, "island": 0, "patch": 0, "content": 1.0}),
    ]
    pair = BirthId(1, 4), BirthId(1, 7)
    stores = (pair[0], 3.0), (BirthId(0, 4), 4.0)
    pairs, patches = ((*pair, False), (*pair, True)), ((1.0, 2.0, 0.5, 20.0),)
    update = replace(UPDATE, samples=tuple(read_samples(rows)))
    assert decode(Update, encode(update), UPDATE_BYTES).samples == (
        ArenaSample(0, 5.0, patches=((1.0, 2.0, 0.5, 1.0),)),
        ArenaSample(1, 5.0, "energy", stores, 0.5, pairs, patches),
        ArenaSample(1, 5.5, over_s=0.5, pairs=pairs[:1]),
    )


def test_text_of_a_reply_cannot_control_a_terminal() -> None:
    reply = OperatorReply("birth  rank\n\x1b[2J    1\x9b\u202e")
    text = decode_operator_reply(encode(reply)).text
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
