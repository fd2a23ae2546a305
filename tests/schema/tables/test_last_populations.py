"""The best robots ever, against a search in Python."""

from pathlib import Path

import numpy as np
import pyarrow as pa
import pytest

from schema.tables import last_populations
from schema.tables.columns import EVALUATIONS
from schema.tables.last_populations import best_ever, fittest_first
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
