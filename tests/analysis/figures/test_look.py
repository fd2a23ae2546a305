"""Tests of the look of figures: width, size of texts, styles, colours, formats."""

import re
from colorsys import rgb_to_hls
from pathlib import Path
from typing import Any

import pytest
from matplotlib import pyplot as plt
from matplotlib.colors import to_rgb
from matplotlib.text import Text

from analysis.comparison.progression import progression
from analysis.figures.courses import over_births
from analysis.figures.flags import STYLES, WIDTHS_IN
from analysis.figures.forms import over_runs
from analysis.figures.look import (
    OTHERS,
    THESIS,
    Look,
    chosen_colours,
    dress,
    dressed_in,
    in_look,
)
from analysis.figures.style import colours, save
from schema.errors import RevolveError
from tests.analysis.drawn import table

NAMES = [*THESIS, "a-user's-own-experiment"]
POPULATIONS = table("populations", [
    {"experiment": name, "folder": f"{name}-{run}", "island": 0,
     "births": births, "fitness": 0.1 * place + births / 100 + run / 9}
    for place, name in enumerate(NAMES) for run in range(6) for births in (15, 900)
])  # fmt: skip
OUTCOMES = table("outcomes", [
    {"experiment": name, "folder": f"{name}-{run}", "births": 900,
     "fitness": 0.1 * place + run / 9, "parts": 4.0 + run, "hidden": 1.0 + place,
     "joints": 3.0 + run}
    for place, name in enumerate(NAMES) for run in range(6)
])  # fmt: skip
TABLES = {
    "populations": POPULATIONS,
    "progression": progression(POPULATIONS),
    "outcomes": OUTCOMES,
}
PANELS = {"parts": "parts", "hidden": "hidden neurons", "joints": "joints"}


def drawn(name: str) -> Any:  # noqa: ANN401 - plotnine has no types
    if name == "courses":
        return over_births(TABLES, "fitness", "mean fitness").draw()
    panels = {"fitness": "mean fitness"} if name == "spread" else PANELS
    return over_runs(TABLES, panels).draw()


@pytest.mark.parametrize("width", [*WIDTHS_IN])
@pytest.mark.parametrize("name", ["courses", "spread", "panels"])
def test_texts_are_inside_and_of_seven_points_at_least(name: str, width: str) -> None:
    with dressed_in(Look(WIDTHS_IN[width], "print")):
        figure = drawn(name)
        dress(figure)
    figure.canvas.draw()
    assert figure.get_figwidth() == WIDTHS_IN[width]
    edge = figure.bbox.padded(1.0)
    texts = [
        one for one in figure.findobj(Text) if one.get_text() and one.get_visible()
    ]
    assert len(texts) > len(NAMES)
    for text in texts:
        assert float(text.get_fontsize()) >= 7.0, text
        box = text.get_window_extent()
        assert edge.x0 <= box.x0, text
        assert box.x1 <= edge.x1, text
    plt.close(figure)


@pytest.mark.parametrize("style", STYLES)
def test_experiments_differ_in_each_style_and_are_read_on_its_paper(style: str) -> None:
    with dressed_in(Look(style=style)):
        paint = {in_look(colour) for colour in (*THESIS.values(), *OTHERS)}
        paper, ink = (rgb_to_hls(*to_rgb(in_look(one)))[1] for one in ("white", "#333"))
        hues = [rgb_to_hls(*to_rgb(one)) for one in paint]
    assert (paper > ink) is (style != "dark")
    assert len(paint) == (5 if style == "print" else len(THESIS) + len(OTHERS))
    assert min(abs(light - paper) for _, light, _ in hues) > 0.2
    if style == "print":
        assert {saturation for *_, saturation in hues} == {0.0}


def test_lines_and_areas_of_the_print_style_differ_without_colours() -> None:
    figure = plt.figure()
    axes = figure.add_subplot()
    paint = [*colours(NAMES).values()]
    for place, colour in enumerate(paint):
        axes.plot([0, 1], [place, place], color=colour)
        axes.bar(place, 1, color=colour)
        axes.fill_between([0, 1], 0, 1, color=colour, alpha=0.2)
    with dressed_in(Look(style="print")):
        dress(figure)
    lines: list[Any] = [*axes.lines]
    dashes = [str(one._dash_pattern) for one in lines]
    assert len({*dashes}) == 4
    shades = [one.get_color()[0] for one in lines]
    assert len({*zip(shades, dashes, strict=True)}) == len(NAMES)
    assert len({one.get_hatch() for one in axes.patches}) == len(NAMES)
    assert {one.get_hatch() for one in axes.collections} == {None}
    plt.close(figure)


def test_chosen_colours_are_those_of_the_legend_in_all_styles() -> None:
    names = ["b", "scenario1"]
    chosen = chosen_colours(["red", "#00ff00"], names)
    for style in STYLES:
        with dressed_in(Look(style=style, chosen=chosen)):
            assert colours([*names, "c"])["b"] == in_look("red") == "#ff0000"
            assert colours(names)["scenario1"] == "#00ff00"
    assert chosen_colours(["tab10"], names)["b"] == "#1f77b4"
    assert chosen_colours([], names) == {}
    ends = chosen_colours(["Greys"], names).values()
    assert len({*ends}) == 2


@pytest.mark.parametrize(
    ("given", "text"),
    [
        (["red", "blurple"], "must be colours, or a colour map, of matplotlib, got"),
        (["red"], "--colours: 1 colour for 2 experiments"),
        (["Set1"], "--colours: 9 colours for 10 experiments"),
    ],
)
def test_a_colour_that_does_not_exist_is_refused(given: list[str], text: str) -> None:
    with pytest.raises(RevolveError, match=re.escape(text)):
        chosen_colours(given, list("ab") if "Set1" not in given else list("abcdefghij"))


def test_vector_formats_hold_text_and_their_fonts(tmp_path: Path) -> None:
    figure, axes = plt.subplots(figsize=(3.5, 2.0))
    axes.set_xlabel("births on Møn")
    picture = save(figure, tmp_path / "one", ("svg", "pdf"))
    assert picture.startswith(b"\x89PNG")
    assert {path.suffix for path in tmp_path.iterdir()} == {".svg", ".pdf"}
    assert ">births on Møn</text>" in (tmp_path / "one.svg").read_text("utf-8")
    stored = (tmp_path / "one.pdf").read_bytes()
    # A TrueType font, in a page of 3.5 by 2 inches.
    assert b"/FontFile2" in stored
    assert b"/MediaBox [ 0 0 252 144 ]" in stored
