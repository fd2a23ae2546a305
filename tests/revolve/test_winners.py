"""Which recorded evaluation ``robustness`` and ``ablate`` repeat."""

import pyarrow as pa

from revolve.cli.winners import _fittest_first
from schema.robot.ids import BirthId
from schema.tables.columns import TABLES
from schema.wire.recorded import last_recorded

WANDERER, SETTLER = BirthId(0, 1), BirthId(0, 2)


def rows(table: str, *wanted: tuple[int, int, int]) -> pa.Table:
    names = ("island", "birth", "trial")
    schema = pa.schema([TABLES[table].field(name) for name in names])
    return pa.Table.from_pylist(
        [dict(zip(names, row, strict=True)) for row in wanted], schema
    )


def test_of_equally_fit_robots_that_of_the_first_birth_precedes() -> None:
    found = pa.table(
        {
            "island": [0, 0, 1, 0, 0],
            "birth_island": [1, 0, 0, 0, 0],
            "birth": [2, 5, 4, 4, 3],
            "fitness": [0.5, 0.5, 0.5, 0.5, 0.0],
            "is_failed": [False, False, False, False, True],
        }
    )
    assert _fittest_first(found.to_pylist()) == [3, 2, 1, 0, 4]


def test_last_evaluation_on_an_island_is_repeated() -> None:
    """Number 0 of a robot that learnt there is its best trial, later ones are not."""
    evaluations = rows("evaluations", (0, 1, 0), (0, 2, 0), (1, 1, 1), (0, 1, 2))
    born = pa.array([None, None, 0, None], pa.uint32())
    evaluations = evaluations.append_column("birth_island", born)
    evaluations = evaluations.append_column("simulated_s", pa.nulls(4, pa.float64()))
    points = pa.array([None, None, 7, 9], pa.int64())
    evaluations = evaluations.append_column("point", points)
    trials = rows("learning", (0, 1, 0), (0, 1, 3), (0, 2, 0), (0, 2, 4))
    fitness = pa.array([0.5, 1.5, 0.5, 1.5])
    trials = trials.append_column("fitness", fitness)
    found = last_recorded(evaluations, trials)
    assert {key: (trial, point) for key, (trial, _, point) in found.items()} == {
        (0, WANDERER): (2, 9),
        (0, SETTLER): (4, None),
        (1, WANDERER): (1, 7),
    }
