"""Robots of births with what they learnt in arenas, and best trials."""

from typing import Any

import pyarrow as pa

from schema.robot.ids import BirthId
from schema.tables.columns import TABLES
from schema.tables.learnt import best_trials, with_learnt


def rows(table: str, *wanted: dict[str, Any]) -> pa.Table:
    """Return rows with the named columns only."""
    schema = pa.schema([TABLES[table].field(name) for name in wanted[0]])
    return pa.Table.from_pylist([*wanted], schema)


def test_robots_that_grew_up_replace_those_at_birth() -> None:
    """On island 0 birth 1 learnt; on island 1 another birth 1 did not."""
    births = rows(
        "births",
        {"birth": 1, "island": 0, "robot": None, "rank": 1},
        {"birth": 1, "island": 1, "robot": b"own", "rank": 2},
    )
    trials = rows(
        "learning",
        {"island": 0, "birth": 1, "trial": 0, "robot": None},
        {"island": 0, "birth": 1, "trial": 1, "robot": b"learnt"},
        {"island": 1, "birth": 1, "trial": 0, "robot": None},
    )
    found = with_learnt(births, trials)
    assert found["robot"].to_pylist() == [b"learnt", b"own"]
    assert found.schema == births.schema
    assert found.drop_columns("robot") == births.drop_columns("robot")
    assert with_learnt(births, trials.slice(2)) is births


def test_best_trial_is_the_first_of_the_fittest() -> None:
    """Birth 1 of two islands are two robots; failed trials are never the best."""
    found = (
        (0, 1, 0, None),
        (0, 1, 2, 0.5),
        (0, 1, 1, 0.5),
        (0, 1, 3, 0.25),
        (1, 1, 0, -2.0),
        (1, 1, 4, -1.0),
        (0, 2, 0, None),
    )
    names = ("island", "birth", "trial", "fitness")
    trials = rows("learning", *(dict(zip(names, row, strict=True)) for row in found))
    assert best_trials(trials) == {BirthId(0, 1): 1, BirthId(1, 1): 4}
