"""Cells over measures: examples by hand, pyribs' cells, and what is refused."""

import numpy as np
import pytest

from schema.experiment.grid import Grid, cell_name, cell_of
from tests.documents import check_refused

GRID = Grid(measures=("limbs", "size"), bounds=((0, 1), (3, 31)), bins=(10, 14))


@pytest.mark.parametrize(
    ("limbs", "size", "name"),
    [
        (0.0, 3.0, "0/0"),
        (0.1, 5.0, "1/1"),
        (0.3, 4.999, "3/0"),  # 0.3 is less than three tenths
        (1.0, 31.0, "9/13"),
        (-5.0, 1e300, "0/13"),
    ],
)
def test_values_belong_to_cells(limbs: float, size: float, name: str) -> None:
    assert cell_name(cell_of(GRID, {"size": size, "limbs": limbs})) == name


@pytest.mark.long
def test_cells_are_those_of_pyribs() -> None:
    archives = pytest.importorskip("ribs.archives")
    lows, highs = zip(*GRID.bounds, strict=True)
    archive = archives.GridArchive(
        solution_dim=1, dims=GRID.bins, ranges=[*zip(lows, highs, strict=True)]
    )
    rng = np.random.default_rng(3)
    some = rng.uniform([-0.2, -2], [1.2, 40], (5000, 2))
    edges = np.stack([np.arange(-3, 24) / 10, np.arange(27) * 2 + 3.0], axis=1)
    values = np.concatenate([some, edges])
    expected = archive.int_to_grid_index(archive.index_of(values))
    cells = [
        cell_of(GRID, dict(zip(GRID.measures, row, strict=True))) for row in values
    ]
    assert cells == [tuple(row) for row in expected.tolist()]


_KEYS = "[measures]\nnames = ['size', 'joints']\n[grid]\n"


@pytest.mark.parametrize(
    ("grid", "message"),
    [
        ("bounds = [[0, 1]]\nbins = [2]", "grid: must have a key 'measures'"),
        ("measures = ['sise']\nbounds = [[0, 1]]\nbins = [2]", "mean 'size'"),
        ("measures = ['size']\nbounds = [[1, 1]]\nbins = [2]", r"got \[1, 1\]"),
        (
            "measures = ['size']\nbounds = [[0, 1]]\nbins = [2, 3]",
            "got .*, 1, 2",
        ),
        (
            "measures = ['size']\nbounds = [[0, 1]]\nbins = [2]\nminimised = ['sise']",
            "'sise' is not in grid.measures; did you mean 'size'",
        ),
        (
            "measures = ['size']\nbounds = [[0, 1]]\nbins = [12_000]",
            "<= 10000 cells, got 12000",
        ),
    ],
)
def test_a_grid_that_makes_no_cells_is_refused(grid: str, message: str) -> None:
    check_refused(_KEYS + grid, message)
