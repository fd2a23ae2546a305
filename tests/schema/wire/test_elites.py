"""Elites that viewers get: rows that count, and rows that are fitter."""

from typing import Any

import msgspec
import pytest

from schema.experiment.document import Experiment, Measures
from schema.experiment.file import experiment_text
from schema.experiment.grid import Grid
from schema.robot.ids import BirthId
from schema.wire.elites import Elite, EliteReader

GRID = Grid(("x",), bounds=((0.0, 1.0),), bins=(4,))
DOCUMENT = experiment_text(
    Experiment(name="e", measures=Measures(names=("x",)), grid=GRID)
)


def row(birth: int, fitness: float | None, x: float, **more: object) -> dict[str, Any]:
    return {"island": 0, "birth_island": None, "birth": birth, "fitness": fitness,
            "measures": [("x", x)], **more}  # fmt: skip


def test_only_fitter_robots_of_a_cell_are_elites() -> None:
    reader = EliteReader(DOCUMENT)
    rows = [(0, 1.0, 0.3), (1, 1.0, 0.3), (2, 2.0, 0.4), (3, 0.5, 0.9), (4, None, 0.1)]
    found = [reader.read("evaluations", row(*each)) for each in rows]
    assert found == [
        Elite(0, 1, (1,), BirthId(0, 0), 1.0), None,
        Elite(0, 3, (1,), BirthId(0, 2), 2.0), Elite(0, 4, (3,), BirthId(0, 3), 0.5),
        None,
    ]  # fmt: skip
    assert [*reader.best.values()] == found[2:4]
    assert (
        msgspec.msgpack.decode(msgspec.msgpack.encode(found[0]), type=Elite) == found[0]
    )


@pytest.mark.parametrize(
    ("table", "more"),
    [
        ("evaluations", {"birth_island": 1}),
        ("evaluations", {"trial": 1}),
        ("evaluations", {"measures": None}),
        ("fitness", {"is_mature": False, "births": 3}),
        ("births", {}),
    ],
)
def test_rows_that_do_not_count(table: str, more: dict[str, object]) -> None:
    assert EliteReader(DOCUMENT).read(table, row(0, 1.0, 0.3, **more)) is None


def test_samples_of_arenas_and_runs_without_a_grid() -> None:
    sample = row(2, 1.0, 0.3, is_mature=True, births=7)
    found = EliteReader(DOCUMENT).read("fitness", sample)
    assert found is not None
    assert (found.births, found.birth) == (7, BirthId(0, 2))
    assert EliteReader("{}").read("fitness", sample) is None
