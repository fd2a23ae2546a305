"""Tests of the catalogue: data of the layers that each figure draws."""

import pyarrow as pa
import pytest

from analysis.comparison.progression import progression
from analysis.figures.catalogue import FIGURES, Figure
from analysis.figures.courses import course as figure_course
from analysis.figures.courses import course_caption, over_births
from analysis.figures.forms import NothingToDraw, over_runs, spread_caption, stacked
from analysis.figures.style import (
    colours,
    file_name,
    in_order,
    label,
    scales,
    two_line_label,
)
from tests.analysis.drawn import Row, layers, table


def outcomes(experiment: str, *fitness: float) -> list[Row]:
    return [
        {"experiment": experiment, "folder": f"{experiment}-{n}", "fitness": value,
         "births": 60}
        for n, value in enumerate(fitness)
    ]  # fmt: skip


def robots(experiment: str, *fitness: float) -> list[Row]:
    return [
        {"experiment": experiment, "fitness": value, "is_last": value > 0}
        for value in fitness
    ]


def courses(*runs: tuple[str, str, tuple[float, ...]]) -> dict[str, pa.Table]:
    """Return the tables of runs: experiment, folder, fitness every 15 births."""
    rows = [
        {"experiment": experiment, "folder": folder, "island": 0, "births": 15 * n,
         "fitness": value}
        for experiment, folder, fitness in runs
        for n, value in enumerate(fitness, 1)
    ]  # fmt: skip
    populations = table("populations", rows)
    return {"populations": populations, "progression": progression(populations)}


FIVE = [("b", f"b-{n}", (0.2 + n, 0.5 + n)) for n in range(5)]
"""Five runs with means 2.2 and 2.5, and variance 2.5."""
HALF = 2.776445 * (2.5 / 5) ** 0.5
"""Half the interval of their mean: Student's t with four degrees of freedom."""


FITNESS = {"fitness": "mean fitness"}


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
    assert figure.labels.y == "mean fitness"
    figure.draw()


@pytest.mark.parametrize(
    ("islands", "recorded", "shown"),
    [
        # Of run 0 the outcome is at 60 of 90 births; run 2 is not finished.
        ([(0, 0), (1, 0), (2, 0)],
         [(0, 0, 60), (0, 0, 90), (1, 0, 30), (1, 0, 60), (2, 0, 60)], [2.0, 2.5]),
        # The outcome is at 60 births, which both islands reach; island 1 has 75.
        ([(0, 0), (0, 1)], [(0, 0, 60), (0, 1, 60), (0, 1, 75)], [1.0, 1.5]),
    ],
)  # fmt: skip
def test_violins_show_the_islands_of_runs_that_end_at_the_outcome(
    islands: list[tuple[int, int]],
    recorded: list[tuple[int, int, int]],
    shown: list[float],
) -> None:
    found = [
        {**row, "folder": f"a-{number}", "island": island}
        for number, island in islands
        for row in robots("a", 1.0 + number + island, 1.5 + number + island)
    ]
    populations = [
        {"experiment": "a", "folder": f"a-{n}", "island": island, "births": births}
        for n, island, births in recorded
    ]
    finished = {number for number, _ in islands} - {2}
    tables = {
        "outcomes": table("outcomes", outcomes("a", *(0.1 * n for n in finished))),
        "robots": table("robots", found),
        "populations": table("populations", populations),
    }
    assert layers(over_runs(tables, FITNESS))["geom_violin"]["value"] == shown
    assert spread_caption(tables, FITNESS).endswith(
        "Pale shapes show the robots of the last populations at those births, each "
        "once, from the least to the greatest value."
    )


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


def test_bands_of_five_or_more_runs_are_not_cut_at_the_axes() -> None:
    four = [("a", f"a-{n}", (0.1, 0.2)) for n in range(4)]
    figure = over_births(courses(*four, *FIVE), "fitness", "f")
    band = layers(figure)["geom_ribbon"]
    assert band["low"] == pytest.approx([2.2 - HALF, 2.5 - HALF])
    assert band["high"] == pytest.approx([2.2 + HALF, 2.5 + HALF])
    assert set(band["experiment"]) == {"b"}
    (axes,) = figure.draw().axes
    low, high = axes.get_ylim()
    assert low < 2.2 - HALF
    assert high > 2.5 + HALF


def test_a_mean_of_one_point_is_a_dot() -> None:
    runs = [("a", "a-0", (0.1,)), ("b", "b-0", (0.2, 0.5)), ("b", "b-1", (0.4,))]
    drawn = layers(over_births(courses(*runs), "fitness", "f"))["geom_point"]
    assert drawn["experiment"] == ["a", "b"]
    assert drawn["mean"] == pytest.approx([0.1, 0.3])


def test_a_mean_ends_where_the_first_run_ends_and_the_caption_says_so() -> None:
    longer = [("b", "b-5", (0.2, 0.5, 9.0, 9.5))]
    tables = courses(*FIVE, *longer)
    figure = over_births(tables, "fitness", "f")
    # Of six runs at 15 and 30 births; the run alone has a thin line up to 60.
    assert figure.data["births"].tolist() == [15, 30]
    assert figure.data["mean"].tolist() == pytest.approx([(11 + 0.2) / 6, 13 / 6])
    thin = figure.layers[1]._data
    assert thin["births"].max() == 60
    ends = "A mean ends where the first of its runs ends: 30 births (b)."
    assert course_caption(tables, "fitness").endswith(ends)
    assert "first of its runs" not in course_caption(courses(*FIVE), "fitness")


def test_long_runs_are_thinned_and_keep_both_ends() -> None:
    run = ("a", "a-0", tuple(float(n) for n in range(1000)))
    shown = figure_course(courses(run), "fitness").by_run["births"].to_pylist()
    assert len(shown) <= 301
    assert (shown[0], shown[-1]) == (15, 15000)


def test_captions_name_what_is_drawn_and_of_how_many_runs() -> None:
    text = course_caption(courses(("a", "a-0", (0.1, 0.2))), "fitness")
    assert text == "Each line is one run (1 of a)."
    text = course_caption(courses(*FIVE, ("a", "a-0", (0.1, 0.2))), "fitness")
    assert text.startswith("Thick lines are means over runs (1 of a, 5 of b).")
    assert "95 % intervals of the mean of 5 or more runs" in text
    tables = {"outcomes": table("outcomes", outcomes("b", 1, 2, 3, 4, 9))}
    text = spread_caption(tables, FITNESS)
    assert text.startswith("Each point is a finished run (5 of b), at 60 births. Boxes")
    assert "Bars" not in text
    assert "Pale shapes" not in text


def test_file_names_say_what_is_shown() -> None:
    stems = [one.stem for one in FIGURES]
    assert len(set(stems)) == len(stems)
    assert {"6.2-fitness-at-the-end", "A-connections-at-the-end"} <= set(stems)
    tree = Figure("G-a b", "Ancestry", "", (), list, "robots", "ancestry-of-a b")
    assert tree.stem == "G-ancestry-of-a-b"


@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("best-robot-of-sw-map=maps/a.png", "best-robot-of-sw-map=maps-a.png"),
        ("S-sweep-a b~2", "S-sweep-a-b~2"),
        ("G-ancestry-of-größe", "G-ancestry-of-größe"),
        ("G-" + "x" * 300, "G-" + "x" * 98),
        ("x" + "ö" * 300, "x" + "ö" * 49),
    ],
)
def test_file_names_are_safe_and_cut_between_characters(text: str, name: str) -> None:
    assert file_name(text) == name


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
            one.drawn(nothing)


def test_an_experiment_has_the_same_colour_in_every_figure() -> None:
    ordered = ["scenario1", "no-selection", "b"]
    assert in_order(["b", "no-selection", "scenario1", "b"]) == ordered
    alone, others = colours(["scenario2"]), colours(["x", "scenario2", "scenario1"])
    assert alone["scenario2"] == others["scenario2"]
    assert len(set(others.values())) == 3
    rows = [{"experiment": name} for name in ("a", "b", "c")]
    paint = colours(["a", "b", "c"])
    for scale in scales({"runs": table("runs", rows)}, ["c", "b"]):
        assert scale.limits == ["b", "c"]
        assert scale.palette(2) == [paint["b"], paint["c"]]


def test_colours_of_many_experiments_differ() -> None:
    """A step of 1 in 8 of red, green or blue can be seen."""
    shades = [
        tuple(int(colour[at : at + 2], 16) for at in (1, 3, 5))
        for colour in colours([f"e{number:02}" for number in range(24)]).values()
    ]
    for at, one in enumerate(shades):
        for other in shades[:at]:
            assert max(abs(a - b) for a, b in zip(one, other, strict=True)) >= 20


@pytest.mark.parametrize(
    ("name", "one_line", "two_lines"),
    [
        ("scenario3", "scenario 3", "scenario 3"),
        ("no-selection", "no selection", "no\nselection"),
        ("scenario1~2", "scenario 1 ~2", "scenario 1\n~2"),
        ("no-selection~2", "no selection ~2", "no selection\n~2"),
        ("no-reproduction", "no reproduction", "no\nreproduction"),
        # Own names are not changed.
        ("my-robots-2", "my-robots-2", "my-robots-2"),
        ("my-long-robots-2", "my-long-robots-2", "my-\nlong-robots-2"),
        ("a-b~3", "a-b ~3", "a-b\n~3"),
        ("scenario10", "scenario10", "scenario10"),
    ],
)
def test_names_of_experiments(name: str, one_line: str, two_lines: str) -> None:
    assert (label(name), two_line_label(name)) == (one_line, two_lines)


def test_each_fitness_function_has_its_own_panel() -> None:
    tables = courses(("a", "a-0", (1.0, 2.0)), ("b", "b-0", (100.0, 300.0)))
    tables["outcomes"] = table("outcomes", [*outcomes("a", 2.0), *outcomes("b", 300.0)])
    names = [("a", "locomotion"), ("b", "x:f (source 1a)")]
    rows = [{"experiment": name, "fitness_function": text} for name, text in names]
    tables["runs"] = table("runs", rows)
    end, curve = over_runs(tables, FITNESS), over_births(tables, "fitness", "fitness")
    assert dict(zip(end.data["experiment"], end.data["panel"], strict=True)) == {
        "a": "locomotion",
        "b": "x:f",
    }
    assert set(curve.data["function"]) == {"locomotion", "x:f"}
    for figure in (end, curve):
        # Each panel has axes of its own: 2 is not beside 300.
        low, high = (axes.get_ylim()[1] for axes in figure.draw().axes)
        assert low < 3
        assert high >= 300
    note = "values of different functions cannot be compared"
    assert note in spread_caption(tables, FITNESS)
    assert note in course_caption(tables, "fitness")
    tables["runs"] = table("runs", rows[:1] * 2)
    assert note not in spread_caption(tables, FITNESS)


def test_null_values_have_no_rows() -> None:
    rows = table("outcomes", [*outcomes("a", 0.1), {"experiment": "b"}])
    assert stacked(rows, FITNESS)["value"].tolist() == [0.1]
