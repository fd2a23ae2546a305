"""Robots of runs: the best of the last populations, and what they learnt."""

from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pytest

from schema.robot.ids import BirthId
from schema.tables import last_populations
from schema.tables.columns import EVALUATIONS, TABLES
from schema.tables.last_populations import best_ever, fittest_first
from schema.tables.learnt import best_trials, with_learnt
from tests.schema.tables.test_files import ROW, write_parquet


def test_the_best_ever_come_first_each_with_its_greatest_fitness(
    tmp_path: Path,
) -> None:
    """Robots are evaluated several times, fail, migrate and are equally fit."""
    rng = np.random.default_rng(5)
    rows = []
    for number in range(600):
        home, birth, fitness = rng.integers(0, (3, 40, 12)).tolist()
        island = int(rng.integers(0, 3))
        rows.append(
            {
                **ROW,
                "record": number,
                "island": island,
                "birth_island": None if island == home else home,
                "birth": birth,
                "fitness": fitness - 6.5 if fitness else None,
            }
        )
    write_parquet(tmp_path, pa.Table.from_pylist(rows, EVALUATIONS))
    greatest: dict[tuple[int | None, ...], float] = {}
    for row in rows:
        key = (row["island"], row["birth_island"], row["birth"])
        if row["fitness"] is not None:
            greatest[key] = max(greatest.get(key, row["fitness"]), row["fitness"])
    names = ("island", "birth_island", "birth", "fitness")
    expected = sorted(
        (
            dict(zip(names, (*key, fitness), strict=True))
            for key, fitness in greatest.items()
        ),
        key=fittest_first,
    )
    found = [{name: row[name] for name in names} for row in best_ever(tmp_path)]
    assert found == expected


def test_only_rows_that_may_be_first_are_compared_in_python(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    rows = [
        {**ROW, "record": birth, "birth": birth, "fitness": min(birth, 990) / 100}
        for birth in range(1000)
    ]
    write_parquet(tmp_path, pa.Table.from_pylist(rows, EVALUATIONS))
    births: list[int] = []

    def counted(row: last_populations.Row) -> tuple[float, ...]:
        births.append(row["birth"])
        return fittest_first(row)

    monkeypatch.setattr(last_populations, "fittest_first", counted)
    first = next(best_ever(tmp_path))
    assert (first["birth"], first["fitness"]) == (990, 9.9)
    assert sorted(births) == list(range(990, 1000))


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
