"""Tests of the catalogue: data of the layers that each figure draws."""

import pytest

from analysis.figures.catalogue import FIGURES
from analysis.figures.forms import NothingToDraw, over_births, over_runs, stacked
from analysis.figures.style import colours, in_order, label
from tests.analysis.drawn import Row, layers, table


def outcomes(experiment: str, *fitness: float) -> list[Row]:
    return [
        {
            "experiment": experiment,
            "folder": f"{experiment}-{n}",
            "fitness": value,
            "births": 60,
        }
        for n, value in enumerate(fitness)
    ]


def robots(experiment: str, *fitness: float) -> list[Row]:
    return [
        {"experiment": experiment, "fitness": value, "is_last": value > 0}
        for value in fitness
    ]


def course(experiment: str, runs: int, *mean: float) -> list[Row]:
    return [
        {"experiment": experiment, "measure": "fitness", "births": 15 * n, "runs": runs,
         "mean": value, "low": value - 0.1, "high": value + 0.1, "least": value,
         "greatest": value + 0.05}
        for n, value in enumerate(mean, 1)
    ]  # fmt: skip


FITNESS = {"fitness": "fitness [m/s]"}


def test_spread_shows_runs_as_points_and_robots_as_violins() -> None:
    figure = over_runs(
        {
            "outcomes": table(
                "outcomes",
                [*outcomes("scenario1", 0.1, 0.4, 0.3), *outcomes("b", 1, 2, 3, 4, 9)],
            ),
            "robots": table(
                "robots", [*robots("scenario1", 0.2, 0.6, -1.0), *robots("b", 5.0, 5.0)]
            ),
        },
        FITNESS,
    )
    shown = layers(figure)
    assert shown["geom_point"]["value"] == [0.1, 0.4, 0.3, 1, 2, 3, 4, 9]
    # Dead robots are ignored; equal values have no violin.
    assert shown["geom_violin"]["value"] == [0.2, 0.6]
    assert set(shown["geom_violin"]["experiment"]) == {"scenario1"}
    # Five runs have a box, three a bar at the median.
    assert set(shown["geom_boxplot"]["experiment"]) == {"b"}
    assert shown["geom_errorbar"]["value"] == [0.3]
    assert figure.labels.y == "fitness [m/s]"
    figure.draw()


def test_panels_keep_their_given_order() -> None:
    panels = {"parts": "z", "hidden": "a"}
    rows = [{"experiment": "x", "parts": 7.0, "hidden": 1.0}]
    figure = over_runs({"outcomes": table("outcomes", rows)}, panels)
    assert list(figure.data["panel"].cat.categories) == ["z", "a"]
    assert figure.data["value"].tolist() == [7.0, 1.0]
    figure.draw()


def test_different_births_of_experiments_are_labelled() -> None:
    rows = [
        {"experiment": name, "births": births, "parts": 7.0, "hidden": 1.0}
        for name, births in (("scenario1", 60), ("scenario3", 30), ("b", 60))
    ]
    tables = {"outcomes": table("outcomes", rows)}
    (feet,) = [
        scale.labels
        for scale in over_runs(tables, {"parts": "z"}).scales
        if "x" in scale.aesthetics
    ]
    assert feet == ["scenario 1\n60 births", "scenario 3\n30 births", "b\n60 births"]
    several = over_runs(tables, {"parts": "z", "hidden": "a"})
    assert several.labels.x == "60 births: scenario 1, b; 30 births: scenario 3"
    alike = {"outcomes": table("outcomes", rows[::2])}
    alone = over_runs(alike, {"parts": "z", "hidden": "a"})
    assert alone.labels.x == ""


def test_an_interval_is_clipped_at_zero() -> None:
    rows = table("progression", course("b", 3, 0.05, 0.4))
    shown = layers(over_births({"progression": rows}, "fitness", "f"))
    assert shown["geom_ribbon"]["low"] == pytest.approx([0.0, 0.3])


def test_panels_of_zeros_begin_at_zero() -> None:
    rows = [{"experiment": "x", "births": 60, "parts": 7.0, "hidden": 0.0}]
    panels = {"parts": "z", "hidden": "a"}
    figure = over_runs({"outcomes": table("outcomes", rows)}, panels).draw()
    lows, highs = zip(*(axes.get_ylim() for axes in figure.axes), strict=True)
    assert min(lows) > -1.0
    assert max(highs[1], 1.0) == highs[1]
    assert lows[1] > -0.1


def test_bands_are_drawn_for_three_or_more_runs() -> None:
    rows = [*course("a", 2, 0.1, 0.2), *course("b", 3, 0.3, 0.4)]
    shown = layers(
        over_births({"progression": table("progression", rows)}, "fitness", "f")
    )
    assert shown["geom_line"]["mean"] == [0.1, 0.2, 0.3, 0.4]
    assert shown["geom_ribbon"]["low"] == pytest.approx([0.2, 0.3])
    assert set(shown["geom_ribbon"]["experiment"]) == {"b"}


def test_progress_of_few_runs_is_drawn_without_bands() -> None:
    rows = table("progression", course("a", 1, 0.1, 0.2))
    figure = over_births({"progression": rows}, "fitness", "f")
    assert set(layers(figure)) == {"geom_line"}
    figure.draw()


def test_missing_data_is_named() -> None:
    empty = {name: table(name, []) for name in ("outcomes", "progression")}
    with pytest.raises(NothingToDraw, match="no finished run could be measured"):
        over_runs(empty, FITNESS)
    with pytest.raises(NothingToDraw, match="fitness at two numbers of births"):
        over_births(empty, "fitness", "f")
    none = {"outcomes": table("outcomes", [{"experiment": "a", "rank": 1.0}])}
    with pytest.raises(NothingToDraw, match="has a value of fitness"):
        over_runs(none, FITNESS)


def test_catalogue_has_all_figures_of_the_thesis_and_each_names_missing_data() -> None:
    # Figures of the thesis except rendered ones, then further ones.
    numbers = [one.number for one in FIGURES]
    thesis = [number.rstrip("ab") for number in numbers if number[0].isdigit()]
    assert list(dict.fromkeys(thesis)) == [
        *(f"6.{n}" for n in range(1, 18) if n != 10),
        "7.1",
    ]
    nothing = {
        name: table(name, [])
        for name in ("outcomes", "progression", "runs", "populations", "extremities",
                     "findings", "robots")
    }  # fmt: skip
    for one in FIGURES:
        with pytest.raises(NothingToDraw):
            one.draw(nothing)


def test_an_experiment_has_the_same_colour_in_every_figure() -> None:
    assert in_order(["b", "no-selection", "scenario1", "b"]) == [
        "scenario1",
        "no-selection",
        "b",
    ]
    alone, others = colours(["scenario2"]), colours(["x", "scenario2", "scenario1"])
    assert alone["scenario2"] == others["scenario2"]
    assert len(set(others.values())) == 3
    assert [label("scenario3"), label("no-selection")] == ["scenario 3", "no selection"]


def test_null_values_have_no_rows() -> None:
    rows = table("outcomes", [*outcomes("a", 0.1), {"experiment": "b"}])
    assert stacked(rows, FITNESS)["value"].tolist() == [0.1]
