"""Maps of sweeps: which runs they show, and which form they have."""

from collections.abc import Sequence
from typing import Any

import pyarrow as pa
import pytest
from matplotlib import pyplot as plt

from analysis.figures.forms import NothingToDraw
from analysis.figures.sweeps import sweep_caption, sweep_map, sweep_runs
from tests.analysis.drawn import table


def _tables(
    points: list[dict[str, Any]], fitness: Sequence[float | None] | None = None
) -> dict[str, pa.Table]:
    """Return the tables of one run per point; fitness is the sum of its numbers."""
    sweeps, outcomes = [], []
    for number, point in enumerate(points):
        names = {"experiment": "e", "folder": f"f{number}"}
        numbers = [each for each in point.values() if isinstance(each, float)]
        value = fitness[number] if fitness else sum(numbers)
        outcomes.append({**names, "births": 9, "fitness": value, "size": 5.0})
        for setting, each in point.items():
            number_of = each if isinstance(each, float) else None
            row = {"setting": setting, "value": str(each), "number": number_of}
            sweeps.append({**names, **row})
    return {"sweeps": table("sweeps", sweeps), "outcomes": table("outcomes", outcomes)}


GRID = [{"a.b": a, "c": c} for a in (1.0, 2.0) for c in (10.0, 30.0) for _ in range(2)]


def test_a_grid_of_two_settings_is_a_map_of_means_over_runs() -> None:
    figure = sweep_map(_tables(GRID), "e")
    panel = figure.axes[0]
    (picture,) = panel.get_images()
    array = picture.get_array()
    assert array is not None
    assert array.tolist() == [[11.0, 12.0], [31.0, 32.0]]
    assert (panel.get_xlabel(), panel.get_ylabel()) == ("a.b", "c")
    # One panel and its colour bar: off-line populations have one size.
    assert len([each for each in figure.axes if each.get_visible()]) == 2
    plt.close(figure)
    assert sweep_caption(_tables(GRID), "e") == (
        "Means over finished runs at each point of the sweep (8 runs at 4 points). "
        "Mean fitness is highest at a.b = 2, c = 30: 32 (sd 0), then at a.b = 1, "
        "c = 30: 31 (sd 0). All runs of a point are equal: no interval of the "
        "difference."
    )


def test_a_caption_says_how_sure_the_best_point_is() -> None:
    """Means 2 and 2.5 of two runs each, variances 0.5 and 0.5: t of 2 d.f. is 4.303."""
    points = [{"a": 1.0}, {"a": 1.0}, {"a": 2.0}, {"a": 2.0}]
    assert sweep_caption(_tables(points, [1.5, 2.5, 2.0, 3.0]), "e").endswith(
        "Each point is a run; the line joins means over runs. Mean fitness is highest "
        "at a = 2: 2.5 (sd 0.71), then at a = 1: 2 (sd 0.71). The difference of these "
        "two, 0.5 (95 % interval -2.5 to 3.5, Welch's t), is not shown; the best of "
        "many points is often best by chance."
    )
    alone = sweep_caption(_tables([{"a": 1.0}, {"a": 2.0}]), "e")
    assert alone.endswith(
        "Each point is a run. Mean fitness is highest at a = 2: 2, then at a = 1: 1. "
        "One run at a point has no spread; --repeats adds runs."
    )


def test_a_caption_names_no_best_point_among_those_without_fitness() -> None:
    points = [{"a": 1.0}, {"a": 2.0}, {"a": 3.0}]
    one = "One run at a point has no spread; --repeats adds runs."
    best = f"highest at a = 1: 1.5, then at a = 3: 0.5. {one}"
    none = "(3 runs at 3 points). Each point is a run."
    for fitness, end in (([1.5, None, 0.5], best), ([None] * 3, none)):
        assert sweep_caption(_tables(points, fitness), "e").endswith(end)


def test_settings_keep_their_digits() -> None:
    points = [{"a": 2404.0, "b": 0.0625}, {"a": 2404.0, "b": 0.1234}] * 2
    points += [{"a": 1e-7, "b": 0.0625}, {"a": 1e-7, "b": 0.1234}] * 2
    assert "highest at a = 2404, b = 0.1234:" in sweep_caption(_tables(points), "e")
    figure = sweep_map(_tables(points), "e")
    panel = figure.axes[0]
    ticks = [each.get_text() for each in panel.get_xticklabels()]
    assert ticks == ["1e-07", "2404"]
    assert [each.get_text() for each in panel.get_yticklabels()] == ["0.0625", "0.1234"]
    plt.close(figure)


def test_scattered_settings_have_a_panel_each() -> None:
    points = [{"a": 1.0, "b": 4.0}, {"a": 2.0, "b": 5.0}, {"a": 3.0, "b": 6.0}]
    figure = sweep_map(_tables(points), "e")
    assert [panel.get_xlabel() for panel in figure.axes] == ["a", "b"]
    plt.close(figure)
    words = [{"a": "x", "b": 1.0}, {"a": "y", "b": 1.0}]
    figure = sweep_map(_tables(words), "e")
    assert [each.get_text() for each in figure.axes[0].get_xticklabels()] == ["x", "y"]
    plt.close(figure)


def test_runs_of_other_experiments_are_not_shown() -> None:
    tables = _tables(GRID)
    other = {"experiment": "o", "folder": "o", "births": 9, "fitness": 99.0}
    more = table("outcomes", [other])
    tables["outcomes"] = pa.concat_tables([tables["outcomes"], more])
    assert sweep_runs(tables, "e").frame["fitness"].max() == 32
    tables["outcomes"] = more
    with pytest.raises(NothingToDraw, match="no run of the sweep e is finished"):
        sweep_map(tables, "e")
