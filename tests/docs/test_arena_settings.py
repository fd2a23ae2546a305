"""The rows of docs/sweeps belong to its documents; tables in the page, and by hand."""

from pathlib import Path

import pyarrow as pa
import pytest

from docs.arena_settings import (
    CHECK,
    GRID,
    INTERVAL,
    LIMIT,
    ROWS,
    SHARE,
    Frame,
    check_lines,
    interpolated,
    kept,
    setting_lines,
    write_page,
)
from schema.experiment.file import experiments_of

REPEATS = 3


def rows(*points: tuple[float, float, float]) -> Frame:
    """Return rows with the interval, share and mean fitness of each point."""
    names = (INTERVAL, SHARE, "fitness")
    point_rows = [dict(zip(names, point, strict=True)) for point in points]
    frame = pa.Table.from_pylist(point_rows).to_pandas()
    same = {"fitness_best": 0.5, "late_gain": 0.25, "diversity": 8.0}
    counts = {"size_mean": 9.0, "size_least": 5, "births": 50, "birth_s": 12.0}
    return frame.assign(**same, **counts)


CORNERS = rows((10.0, 0.2, 1.0), (10.0, 0.6, 2.0), (20.0, 0.2, 3.0), (20.0, 0.6, 8.0))


@pytest.mark.parametrize("name", [GRID, CHECK, LIMIT])
def test_each_point_of_a_document_has_three_rows(name: str) -> None:
    found = kept(name)
    points = experiments_of(str(ROWS / f"{name}.toml"))
    for point in points:
        assert point.sweep is not None
        chosen = point.sweep.chosen
        own = found[(found[list(chosen)] == [*chosen.values()]).all(axis=1)]
        assert (len(own), set(own["births"])) == (REPEATS, {point.births})
    assert len(found) == REPEATS * len(points)


def test_no_point_of_the_check_is_one_of_the_sweep() -> None:
    checked, swept = kept(CHECK), kept(GRID)
    assert not set(checked[INTERVAL]) & set(swept[INTERVAL])
    assert not set(checked[SHARE]) & set(swept[SHARE])


def test_tables_of_the_page_are_those_of_the_rows() -> None:
    assert write_page(is_check=True) == 0, "run python -m docs.arena_settings page"


def test_a_point_between_those_of_the_grid_by_hand() -> None:
    # 1.5 and 5.5 at the middle share; a quarter of the way between them.
    assert interpolated(CORNERS, "fitness", 12.5, 0.4) == pytest.approx(2.5)


def test_means_of_a_setting_by_hand() -> None:
    # Student's t with 1 degree of freedom: 12.706 * 0.5 = 6.353.
    *_, line = setting_lines(CORNERS[CORNERS[SHARE] == 0.2], INTERVAL)
    assert line == (
        "| 20 | 1 | 3.0000 (nan to nan) | 0.5000 | 25 % | 8.0 | 9.0 (5.0) | 12.0 |"
    )
    _, _, line, _ = setting_lines(CORNERS, INTERVAL)
    assert line.startswith("| 10 | 2 | 1.5000 (-4.8531 to 7.8531) | ")


def test_check_by_hand() -> None:
    *_, line = check_lines(
        CORNERS, rows((15.0, 0.4, 2.0), (15.0, 0.4, 3.0), (15.0, 0.4, 5.5))
    )
    assert line.startswith("| 15 | 0.4 | 3 | 3.5000 | 3.5000 (2.0000 to 5.5000) | ")


def test_documents_and_rows_belong_together() -> None:
    assert {path.stem for path in Path(ROWS).glob("*.csv")} == {GRID, CHECK, LIMIT}
