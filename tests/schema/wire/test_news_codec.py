"""News survive their bytes; other bytes are refused."""

import contextlib

import pytest
from hypothesis import given
from hypothesis import strategies as st

from schema.errors import MalformedMessage
from schema.robot.ids import BirthId
from schema.robot.robot import Part, Robot
from schema.tables.columns import Row
from schema.wire.news import Crewman, Departed, Level, Migrant, Newborn, News, levels
from schema.wire.news_codec import decode_news, encode_news

CORE = Robot((Part("Core", -1, -1, -1, 0, (0.1, 0.2, 0.3)),))
NEWS = News(
    run="host:/runs/a",
    epoch=3,
    sequence=17,
    is_whole=True,
    experiment="scenario3",
    births=(
        Newborn(BirthId(0, 0), (), 1, 1, 0.0, None),
        Newborn(BirthId(0, 1), (BirthId(0, 0), BirthId(1, 4)), 2, 2, 12.5, CORE),
        Newborn(BirthId(1, 4), (), 1, 5, None, CORE),
    ),
    deaths=(Departed(0, BirthId(0, 0), 2, 30.0, "cull"),),
    levels=(Level(0, 2, 2, 1, 0.25, 0.25, (BirthId(0, 0), BirthId(0, 1))),),
    migrants=(
        Migrant(BirthId(0, 1), 0, 1, 9, 30, 60.5),
        Migrant(BirthId(0, 0), 1, 0, 2, 15, None),
    ),
    workers=(Crewman("w-1", "x86", (0, 2)), Crewman("w-2", "arm", ())),
    document='{"name": "scenario3"}',
)


def test_news_come_back_from_their_bytes() -> None:
    assert decode_news(encode_news(NEWS)) == NEWS


@given(st.binary(max_size=200))
def test_any_bytes_are_news_or_refused(data: bytes) -> None:
    with contextlib.suppress(MalformedMessage):
        decode_news(data)


def test_a_body_that_is_no_tree_is_refused() -> None:
    two_cores = Robot((CORE.parts[0], CORE.parts[0]))
    bad = News(
        "r", 0, 1, False, "e", (Newborn(BirthId(0, 0), (), 1, 1, None, two_cores),)
    )
    with pytest.raises(MalformedMessage):
        decode_news(encode_news(bad))


def test_a_level_is_the_mean_of_those_who_are_judged() -> None:
    rows: list[Row] = [
        {"island": 0, "births": 2, "birth": 0, "fitness": 0.5},
        {"island": 0, "births": 2, "birth": 1, "fitness": None},
        {"island": 0, "births": 3, "birth": 0, "fitness": 0.25},
        {"island": 0, "births": 3, "birth": 1, "fitness": 0.75},
        {"island": 0, "births": 3, "birth": 2, "fitness": None},
    ]
    assert levels(rows) == [
        Level(0, 2, 2, 1, 0.5, 0.5, (BirthId(0, 0), BirthId(0, 1))),
        Level(0, 3, 3, 2, 0.5, 0.75, tuple(BirthId(0, each) for each in range(3))),
    ]
