"""Tests of the figures of islands, robots, named measures and speed."""

import numpy as np
import pyarrow as pa
import pytest
from matplotlib.text import Text

from analysis.figures.bench import speed
from analysis.figures.courses import measures_over_births
from analysis.figures.forms import NothingToDraw, Tables
from analysis.figures.islands import between, fitness_by_island, migration_graph
from analysis.figures.robots import extremities_and_fitness, variability
from analysis.measures.fitness_functions import MEASURE_UNITS
from tests.analysis.drawn import layers, table
from worker.measures import BUILT_IN


def test_arrows_count_migrants_between_islands() -> None:
    went = [(0, 1, 2), (0, 1, 0), (1, 0, 0), (2, 0, 1)]
    rows = [
        {"experiment": "ring", "island": island, "to": to, "living": living}
        for island, to, living in went
    ]
    figure = migration_graph({"migrants": table("migrants", rows)})
    arrows = figure.data.sort_values(["island", "to"])
    assert arrows["line_count"].tolist() == [2, 1, 1]
    assert arrows["line_mean"].tolist() == [0.5, 0.0, 1.0]
    # Island 0 is on top, 1 at the lower right, 2 at the lower left.
    assert (arrows["yend"] - arrows["y"] > 0).tolist() == [False, True, True]
    assert (arrows["xend"] - arrows["x"] > 0).tolist() == [True, False, True]
    figure.draw()


def test_each_island_has_a_line() -> None:
    rows = [
        {"experiment": "ring", "folder": "f", "island": island, "births": births,
         "fitness": 0.1 * island + births}
        for island in range(2)
        for births in (15, 30)
    ]  # fmt: skip
    runs = [{"folder": "f", "islands": 2}]
    figure = fitness_by_island(
        {"runs": table("runs", runs), "populations": table("populations", rows)}
    )
    assert figure.data["island"].tolist() == ["0", "0", "1", "1"]
    assert figure.data["fitness"].tolist() == pytest.approx([15, 30, 15.1, 30.1])
    figure.draw()
    assert "geom_point" not in layers(figure)
    young = {"runs": table("runs", runs), "populations": table("populations", rows[:3])}
    assert layers(fitness_by_island(young))["geom_point"]["island"] == ["1"]
    alone = {"runs": table("runs", [{"folder": "f", "islands": 1}])}
    with pytest.raises(NothingToDraw, match="several islands"):
        fitness_by_island({**alone, "populations": table("populations", rows)})


def test_lines_of_many_islands_have_different_colours() -> None:
    rows = [
        {"experiment": "ring", "folder": "f", "island": island, "births": births,
         "fitness": births}
        for island in range(12)
        for births in (15, 30)
    ]  # fmt: skip
    runs = table("runs", [{"folder": "f", "islands": 12}])
    tables = {"runs": runs, "populations": table("populations", rows)}
    lines = fitness_by_island(tables).draw().axes[0].lines
    assert len({str(line.get_color()) for line in lines}) == len(lines) == 12


def test_within_and_between_islands_are_means_over_runs() -> None:
    rows = [
        {"experiment": "ring", "births": 15, "within": within, "between": between}
        for within, between in ((2.0, 5.0), (4.0, 8.0))
    ]
    runs = [{"experiment": "ring", "folder": "f", "islands": 2}]
    tables = {"runs": table("runs", runs), "between": table("between", rows)}
    figure = between(tables)
    shown = dict(zip(figure.data["pairs"], figure.data["distance"], strict=True))
    assert shown == {"within islands": 3.0, "between islands": 6.5}
    # No line joins the means of one number of births: they are points.
    points = layers(figure)["geom_point"]
    assert points["pairs"] == ["between islands", "within islands"]
    assert points["distance"] == [6.5, 3.0]
    later = table("between", [*rows, {**rows[0], "births": 30}])
    assert "geom_point" not in layers(between({**tables, "between": later}))


def test_islands_without_enough_births_are_not_said_to_be_missing() -> None:
    runs = [{"folder": "f", "islands": 2}, {"folder": "g", "islands": 1}]
    empty = {name: table(name, []) for name in ("between", "populations")}
    several = {**empty, "runs": table("runs", runs)}
    with pytest.raises(NothingToDraw, match="no run of several islands has 15 births"):
        between(several)
    with pytest.raises(NothingToDraw, match="no run of several islands has a judged"):
        fitness_by_island(several)
    alone = {**empty, "runs": table("runs", runs[1:])}
    for draw in (between, fitness_by_island):
        with pytest.raises(NothingToDraw, match="no run has several islands"):
            draw(alone)


def test_fitness_by_extremities_has_bars_where_five_runs_are() -> None:
    rows = [
        {"experiment": name, "folder": f"{name}{run}", "population": "final",
         "by": "count", "bin": extremities, "fitness": fitness}
        for name, extremities, values in (
            ("a", 4.0, (0.1, 0.2, 0.3, 0.4, 0.5)),
            ("a", 5.0, (0.1, 0.1, 0.2, 0.2)), ("b", 4.0, (0.7,)),
        )
        for run, fitness in enumerate(values)
    ]  # fmt: skip
    figure = extremities_and_fitness(
        {"extremities": table("extremities", rows)}, "count"
    )
    shown = layers(figure)
    # The mean of five runs, Student's t of four degrees of freedom, at the left of 4.
    error = 2.776445 * (0.025 / 5) ** 0.5
    bars = shown["geom_linerange"]
    ends = zip(bars["at"], bars["low"], bars["high"], strict=True)
    known = [bar for bar in ends if not np.isnan(bar).any()]
    assert known == [pytest.approx((3.935, 0.3 - error, 0.3 + error))]
    points = shown["geom_point"]
    assert dict(zip(points["at"], points["fitness"], strict=True)) == pytest.approx(
        {3.935: 0.3, 4.935: 0.15, 4.065: 0.7}
    )
    figure.draw()


@pytest.mark.parametrize(
    ("born", "final"),
    [((4.0, 5.0), (4.0, 5.0)), ((4.0, 5.0), (4.0,)), ((4.0,), (4.0,))],
)
def test_last_populations_are_left_for_any_number_of_runs_and_extremities(
    born: tuple[float, ...], final: tuple[float, ...]
) -> None:
    rows = [
        {"experiment": "a", "folder": "f", "population": population, "by": "count",
         "bin": extremities, "fitness": 0.1}
        for population, bins in (("born", born), ("final", final))
        for extremities in bins
    ]  # fmt: skip
    figure = extremities_and_fitness(
        {"extremities": table("extremities", rows)}, "count"
    )
    titles = [text.get_text() for text in figure.draw().findobj(Text)]
    assert titles.index("last populations") < titles.index("all robots ever evaluated")
    # Lines of one point would be warned of.
    lines = layers(figure)["geom_line"]["fitness"]
    assert len(lines) == sum(len(bins) for bins in (born, final) if len(bins) > 1)


def test_a_speed_is_drawn_beside_the_thesiss() -> None:
    rows = [
        {"benchmark": "arena", "population": size, "factor": factor}
        for size, factor in ((5, 8.0), (5, 10.0), (10, 4.0))
    ] + [{"benchmark": "spider", "population": 5, "factor": 99.0}]
    figure = speed({"benchmark": pa.Table.from_pylist(rows)}, "arena")
    means = dict(zip(figure.data["population"], figure.data["factor"], strict=True))
    assert means == {5: 9.0, 10: 4.0}
    fit = figure.layers[-1]._data
    # The thesis's formula at 5 and 10 robots.
    assert fit["factor"].iloc[[0, -1]].tolist() == pytest.approx([7.5124, 3.4221])
    (axes,) = figure.draw().axes
    assert figure.labels.y == "simulated / wall time"
    # The axis is logarithmic, and has the line of real time.
    assert [tick.get_text() for tick in axes.get_yticklabels()] == ["1", "3", "10"]
    (text,) = axes.texts
    assert text.get_text() == "real time"
    assert text.get_position()[1] == 0


def measured(*robots: tuple[str, str, float]) -> Tables:
    """Return the table of robots: experiment, folder and variability of each."""
    rows = [
        {"experiment": experiment, "folder": folder, "variability": value}
        for experiment, folder, value in robots
    ]
    return {"variability": table("variability", rows)}


def test_density_and_lines_are_those_of_robots_that_differ() -> None:
    figure = variability(
        measured(
            ("a", "a-0", 0.2), ("a", "a-0", 0.4), ("a", "a-1", 0.5),
            ("b", "b-0", 0.3), ("b", "b-1", 0.6),
            ("c", "c-0", 0.7), ("d", "d-0", 1.0), ("d", "d-0", 1.0),
        )
    )  # fmt: skip
    shown = layers(figure)
    assert shown["geom_density"]["variability"] == [0.2, 0.4, 0.5, 0.3, 0.6]
    assert shown["geom_line"]["folder"] == ["a-0", "a-0"]
    figure.draw()


@pytest.mark.parametrize("other", [("b", "b-0", 0.4), ("a", "a-1", 0.2)])
def test_robots_that_do_not_differ_have_no_density(
    other: tuple[str, str, float],
) -> None:
    """One robot of each of two experiments, or two equal ones of one."""
    with pytest.raises(NothingToDraw, match="no two robots of an experiment differ"):
        variability(measured(("a", "a-0", 0.2), other))


def test_figure_is_drawn_without_a_warning() -> None:
    rows = [
        {"experiment": "a", "folder": "a-1", "island": 0, "measure": measure,
         "births": births, "mean": 0.1 * births, "about": about}
        for births in (15, 30)
        for measure, about in (
            ("height", ""), ("bare", "A number."), ("own", "Pull [N] of a rope [m/s].")
        )
    ]  # fmt: skip
    tables = {"named_measures": pa.Table.from_pylist(rows)}
    # Warnings are errors: a scale without a layer that uses it is one.
    drawn = measures_over_births(tables).draw()
    (line,) = drawn.axes[0].lines or drawn.axes[0].collections
    assert line is not None
    texts = {text.get_text() for text in drawn.findobj(Text)}
    assert {"height [m]", "bare", "own [m/s]"} <= texts


def test_a_measure_at_one_number_of_births_is_a_dot() -> None:
    row = {"experiment": "a", "folder": "a-1", "island": 0, "births": 15, "mean": 0.1}
    rows = [{**row, "measure": "height", "about": ""}]
    figure = measures_over_births({"named_measures": pa.Table.from_pylist(rows)})
    assert layers(figure)["geom_point"]["mean"] == [0.1]


def test_units_are_those_of_the_docstrings() -> None:
    assert MEASURE_UNITS.keys() < BUILT_IN.keys()
    for name, function in BUILT_IN.items():
        unit = MEASURE_UNITS.get(name, "1")
        assert f"[{unit}]" in (function.__doc__ or "").partition("Source")[0], name
