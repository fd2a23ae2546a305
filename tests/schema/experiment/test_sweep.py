"""Sweeps: their points, the experiments at these, and what is refused."""

from itertools import pairwise
from pathlib import Path

import pytest
from scipy.stats import qmc

from schema.errors import ExperimentError
from schema.experiment.file import (
    experiment_from_text,
    experiment_text,
    read_draft,
    read_experiment,
)
from schema.experiment.sweep import Range, Sweep, sweep_points

GRID = """
name = "small"
births = 20
[sweep]
settings."selection.population" = [5, 10]
settings."variation.p_duplicate_subtree" = { low = 0.1, high = 0.3, steps = 3 }
"""


def _written(folder: Path, text: str) -> str:
    path = folder / "x.toml"
    path.write_text(text)
    return str(path)


def test_a_grid_has_all_combinations_the_last_setting_first(tmp_path: Path) -> None:
    found = read_draft(_written(tmp_path, GRID)).checked()
    assert [each.name for each in found] == [f"small-{number}" for number in range(6)]
    assert [
        (each.selection.population, each.variation.p_duplicate_subtree)
        for each in found
    ] == [(5, 0.1), (5, 0.2), (5, 0.3), (10, 0.1), (10, 0.2), (10, 0.3)]
    assert found[1].sweep is not None
    assert found[1].sweep.chosen == {
        "selection.population": 5, "variation.p_duplicate_subtree": 0.2,
    }  # fmt: skip
    assert {each.births for each in found} == {20}


def test_an_experiment_of_a_sweep_is_stored_and_read_as_others(tmp_path: Path) -> None:
    one = read_draft(_written(tmp_path, GRID)).checked()[4]
    assert experiment_from_text(experiment_text(one)) == one


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        (Range(low=1, high=4, steps=4), [1, 2, 3, 4]),
        (Range(low=1, high=2, steps=4), [1, 2]),
        (Range(low=1.0, high=2.0, steps=3), [1.0, 1.5, 2.0]),
        (Range(low=0.01, high=100.0, steps=5, log=True), [0.01, 0.1, 1.0, 10.0, 100.0]),
        (Range(low=1, high=1000, steps=4, log=True), [1, 10, 100, 1000]),
    ],
)
def test_ranges(values: Range, expected: list[float]) -> None:
    found = sweep_points(Sweep(settings={"births": values}))
    assert [point["births"] for point in found] == expected


def test_a_latin_hypercube_has_one_value_in_each_part() -> None:
    spread = Range(low=0.0, high=1.0)
    sweep = Sweep(settings={"a.b": spread, "a.c": spread, "a.d": ("x", "y")}, samples=8)
    points = sweep_points(sweep)
    assert points == sweep_points(sweep)
    assert points != sweep_points(
        Sweep(settings=sweep.settings, samples=8, seed=1)
    )  # fmt: skip
    for key in ("a.b", "a.c"):
        assert sorted(int(8 * point[key]) for point in points) == list(range(8))
    assert sorted(point["a.d"] for point in points) == ["x"] * 4 + ["y"] * 4
    # Better spread than corners: SciPy's measure of a sample, smaller is better.
    sample = [[point["a.b"], point["a.c"]] for point in points]
    assert qmc.discrepancy(sample) < qmc.discrepancy([[0.5 / 8, 0.5 / 8]] * 8)


def test_parts_of_a_logarithmic_range_grow_by_a_factor() -> None:
    spread = Range(low=1.0, high=16.0, log=True)
    points = sweep_points(Sweep(settings={"a.b": spread}, samples=4))
    values = sorted(point["a.b"] for point in points)
    edges = [1.0, 2.0, 4.0, 8.0, 16.0]
    for value, (low, high) in zip(values, pairwise(edges), strict=True):
        assert low <= value <= high


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ("", "sweep.settings: must name at least one setting"),
        ('"births" = []', 'sweep.settings."births": must have at least one value'),
        ('"births" = [1, 1]', "must have each value once, got [1, 1]"),
        ('"births" = {low = 2, high = 1, steps = 2}', "low must be < high, got 2 and"),
        ('"births" = {low = 0, high = 9, steps = 2, log = true}', "low must be > 0"),
        ('"births" = {low = 1, high = 9}', "steps must be >= 2, got none"),
        ('"births" = {low = 1, high = 5000, steps = 5000}', "must have <= 1000 points"),
        ('"name" = ["a", "b"]', "name cannot be swept"),
        ('"islands.0" = [1, 2]', "islands cannot be swept"),
        ('"birth" = [10, 20]', "birth: no such key; did you mean 'births'?"),
        ('"births.x" = [10, 20]', 'sweep.settings."births.x": no such key'),
        ('"births" = 30', 'sweep.settings."births": must be a list, or a range'),
        (
            '"births" = { low = 20, high = 30, step = 3 }',
            "sweep.settings.\"births\".step: no such key; did you mean 'steps'?",
        ),
        ('"births" = { high = 30, steps = 2 }', "\"births\": must have a key 'low'"),
        (
            "selection.population = [5, 10]",
            'a key with dots must be quoted: settings."selection.population" = ...',
        ),
        ('"births" = [10, "x"]', "must be a whole number, got 'x'; in the sweep at "),
        ('"selection.population" = [1, 9]', "selection.population"),
        ('"births" = {low = 1, hihg = 5}', "hihg"),
    ],
)
def test_a_wrong_sweep_is_refused(tmp_path: Path, settings: str, message: str) -> None:
    text = f'name = "x"\nbirths = 20\n[sweep.settings]\n{settings}\n'
    with pytest.raises(ExperimentError) as caught:
        read_draft(_written(tmp_path, text)).checked()
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


ISLANDS = """
name = "x"
births = 20
[sweep]
settings."selection.children" = [5, 6]
[[islands]]
[islands.selection]
population = 5
children = 5
[[islands]]
"""


def test_a_sweep_of_a_setting_that_every_island_replaces_is_refused(
    tmp_path: Path,
) -> None:
    assert len(read_draft(_written(tmp_path, ISLANDS)).checked()) == 2
    own = f"{ISLANDS}[islands.selection]\npopulation = 5\nchildren = 5\n"
    with pytest.raises(ExperimentError, match="sweep: x-0 and x-1 have equal islands"):
        read_draft(_written(tmp_path, own)).checked()


def test_a_sweep_is_no_single_experiment(tmp_path: Path) -> None:
    with pytest.raises(ExperimentError, match="stands for several experiments"):
        read_experiment(_written(tmp_path, GRID))
