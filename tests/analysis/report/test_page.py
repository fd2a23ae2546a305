"""Tests of the report, read by an HTML parser."""

import base64
import io
import re
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc
import pytest
from matplotlib import pyplot as plt
from PIL import Image

from analysis.figures.figure_writer import Drawings
from analysis.measures.outputs import schema
from analysis.report import page as report_page
from analysis.report import thesis
from analysis.report.differences import differences
from analysis.report.interactive import interactive
from tests.analysis.drawn import table
from tests.analysis.reported import NOTHING, drawings, page, tables

VOID = {"meta", "img", "br", "link"}


class Reader(HTMLParser):
    """Collects the text, images, links and ids of a page; tags must be closed."""

    def __init__(self) -> None:
        super().__init__()
        self.open: list[str] = []
        self.sources: list[str] = []
        self.links: list[str] = []
        self.words: list[str] = []
        self.names: list[str] = []
        self.folds: list[str] = []
        self.unfolded: list[str] = []

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        values = dict(attrs)
        if tag not in VOID:
            self.open.append("details open" if "open" in values else tag)
        self.sources += [values["src"] or ""] if "src" in values else []
        self.links += [values["href"] or ""] if "href" in values else []
        self.names += [values["id"] or ""] if "id" in values else []

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop().split()[0] == tag

    def handle_data(self, data: str) -> None:
        if self.open and self.open[-1] in {"style", "script"}:
            return
        if self.open and self.open[-1] == "summary":
            self.folds.append(data)
            self.unfolded += [data] if self.open[-2] == "details open" else []
        self.words.append(data)

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.words).split())


def read_page(given: dict[str, pa.Table], drawn: Drawings = NOTHING) -> Reader:
    text = page(given, drawn)
    assert text.startswith("<!DOCTYPE html>")
    reader = Reader()
    reader.feed(text)
    assert reader.open == []
    return reader


def with_columns(
    given: dict[str, pa.Table], name: str, **columns: list[Any]
) -> dict[str, pa.Table]:
    """Return tables of which one has other values in some columns."""
    changed = given[name]
    for column, values in columns.items():
        field = changed.schema.field(column)
        place = changed.schema.get_field_index(column)
        changed = changed.set_column(place, field, [pa.array(values, field.type)])
    return {**given, name: changed}


@pytest.fixture(scope="module")
def read(tmp_path_factory: pytest.TempPathFactory) -> Reader:
    return read_page(tables(), drawings(tmp_path_factory.mktemp("figures")))


def test_pictures_are_embedded_and_nothing_is_loaded(read: Reader) -> None:
    film, *figures = read.sources
    assert (
        base64.b64decode(film.removeprefix("data:image/gif;base64,"))[:6] == b"GIF89a"
    )
    assert len(figures) == 2
    for source in figures:
        stored = base64.b64decode(source.removeprefix("data:image/png;base64,"))
        with Image.open(io.BytesIO(stored)) as picture:
            assert picture.size == (1400, 140)
            assert picture.convert("RGB").getpixel((700, 70)) == (255, 0, 0)
    text = (
        "Title 6.9. What & why. Figure 6.9 of the thesis; file figures/one.pdf , .png"
    )
    assert text in read.text
    assert "Title A. What & why. File figures/one.pdf , .png; source: <a> file" in (
        read.text
    )


def test_contents_lead_to_every_section_in_order(read: Reader) -> None:
    anchors = [link.removeprefix("#") for link in read.links if link[0] == "#"]
    assert anchors[:4] == ["overview", "robots", "fitness", "comparison"]
    assert {"bodies", "speed", "thesis", "runs", "left-out", "tables"} <= set(anchors)
    others = [link for link in read.links if link[0] != "#"]
    assert others == ["figures/one.html"]
    assert set(anchors) <= set(read.names)
    assert {"figure-6.2", "figure-6.3", "figure-6.9", "figure-A"} <= set(read.names)
    assert not {"islands", "measures"} & set(anchors)


@pytest.mark.parametrize(
    "text",
    [
        # Means of the last populations are 0.1, 0.2 and 0.3, the best 0, 0.5 and 1.
        "3 runs, 165 births; written 2020-01-01",
        "soft 2 finished 60 0.5 25 % 0.25 0.15 1 min 00 s 1",
        "hard & <b> 1 not finished 45 1 – 1 0.3 – – ",
        " hard & <b>: births: 1 instead of 2 ",
        "Fitness function: locomotion [weighted velocity].",
        # Six choices of two runs of four: p of both tails is a third at least.
        "hard & <b> minus soft : +0.05 , 95 % interval 0.01 to 0.09",
        "undecided: the interval excludes 0, but p is not below 0.05; with 2 and 2",
        "with 2 and 2 runs it cannot be below 0.333; if the effect is as seen",
        "if the effect is as seen, 4 runs of each show it four times in five",
        # One run of b is no spread of zero.
        "\u22120.05 (2 and 1 run, at 30 births) no interval",
        "1 measure is equal in all runs: size mean.",
        "measure meaning fitness mean of judged robots",
        "fitness best maximum of judged robots, in the same unit",
        "soft, run 1, seed 7 mean fitness 0.2 at 30 births",
        "mean of 2 runs",
        "soft: fitness 0.3, 25 % of it in later windows. Robot 0:2 of soft-1 (soft, ",
        "hard & <b>: no moving picture: no driver <x>",
        "0 reproduced, 1 not reproduced, 1 undecided.",
        "a <b> fitter > 2 / 3 0.25 – \u22121 – – 0.01 not reproduced so",
        "there is no finished run",
        "soft 1 7 finished 60 1 0.5 0.2 1 min 01 s 1 soft-1",
        "figure 6.1 no benchmark run runs/x broken & gone",
        "revolve analyze runs software version numpy 9.9",
    ],
)
def test_numbers_verdicts_and_provenance_are_shown(read: Reader, text: str) -> None:
    assert text in read.text


def compared(*rows: dict[str, Any]) -> str:
    """Return the section of differences of rows of the comparison."""
    row = {"measure": "fitness", "a": "a", "b": "b", "births": 9, "runs_a": 3,
           "runs_b": 3, "mean_a": 0.25, "mean_b": 0.6, "difference": -0.35,
           "effect": -1.0}  # fmt: skip
    every = [{**row, **changes} for changes in rows]
    found = pa.Table.from_pylist(every, schema("comparison"))
    return differences({**tables(), "comparison": found})


def test_both_comparisons_of_fitness_show_the_pairs_in_one_order() -> None:
    pairs = {"fitness": {"b": 0.3, "c": 0.1}, "fitness_best": {"b": 0.2, "c": 0.4}}
    rows = [
        {"measure": measure, "b": b, "p": p}
        for measure, found in pairs.items()
        for b, p in found.items()
    ]
    lines = re.findall(r"<b>a</b> minus <b>(.)</b>", compared(*rows))
    assert lines == ["c", "b"] * 2


@pytest.mark.parametrize("p", [0.1, None])
def test_equal_runs_have_no_interval_and_keep_their_p(p: float | None) -> None:
    """Three runs of 0.25 each against 0.5, 0.6 and 0.7: p is 2 of 20 ways."""
    text = re.sub("<[^>]+>", "", compared({"p": p}))
    why = "no interval: all runs of one are equal, and they are fewer than ten"
    at = "&minus;0.35 (3 and 3 runs, at 9 births"
    assert (f"{at}; rank-sum p = 0.1){why}" if p else f"{at}){why}") in text


def test_each_fitness_function_has_its_own_plot_and_no_winner() -> None:
    functions = ["locomotion", "locomotion", "goals:far (limit = 2.0, source 1a)"]
    given = with_columns(tables(), "runs", fitness_function=functions)
    given["comparison"] = given["comparison"].slice(0, 0)
    found = read_page(given)
    assert "soft locomotion [weighted velocity] 2 finished" in found.text
    assert "hard & <b> goals:far (limit = 2.0) 1 not finished" in found.text
    far, near = "goals:far (limit = 2.0)", "locomotion"
    for title in ("Fitness over births", "Fitness of the last populations"):
        assert f"{title}: {far}." in found.text
        assert f"{title}: {near}." in found.text
    lists = f"hard & <b> by {far}; soft by {near}."
    assert f"their numbers have different meanings: {lists}" in found.text
    others = found.text.replace("fitter than all", "").replace("a <b> fitter", "")
    assert "fitter" not in others
    # Robot 2 of each run is at the same place in the plots of its own function only.
    assert found.text.count("robot 0:2, hard & <b>, run 0") == 2


@pytest.mark.parametrize("others_s", [None, 9.0])
def test_fitness_in_arenas_and_off_line_has_no_winner(others_s: float | None) -> None:
    runs = tables()["runs"]
    seconds = [
        9.0 if name == "soft" else others_s for name in runs["experiment"].to_pylist()
    ]
    births = runs["births"].to_pylist()
    columns = {"simulated_s": seconds, "arena_births": births, "deaths": [0] * 3}
    text = read_page(with_columns(tables(), "runs", **columns)).text
    where = "in arenas (soft) is measured in another way than off-line (hard & <b>)"
    verdict = "in an arena and off-line: this does not show which is fitter"
    is_mixed = others_s is None
    assert (f"Fitness {where}" in text) == is_mixed
    assert (verdict in text) == is_mixed
    assert ("undecided: the interval excludes 0" in text) != is_mixed


def with_arena(**columns: float) -> dict[str, pa.Table]:
    """Return tables whose second run has some columns of a run with an arena."""
    values = {name: [None, value, None] for name, value in columns.items()}
    return with_columns(tables(), "runs", **values)


def test_an_arena_is_summed_up(tmp_path: Path) -> None:
    given = with_arena(arena_births=60, arena_living=50, deaths=9, simulated_s=125.0)
    text = read_page(given).text
    assert text.count("of simulated time") == 1
    assert (
        "soft, run 1, seed 7: 60 robots were born in 2 min 05 s of simulated time, "
        "9 died, 51 were alive at the end." in text
    )
    assert "Each dot is at the birth of its robot" in text
    with_film = read_page(given, drawings(tmp_path)).text
    assert "simulated alone, from the middle of" in with_film
    assert "Among the robots of an arena it may move differently." in with_film


def test_births_of_off_line_islands_are_no_births_in_arenas() -> None:
    given = with_arena(arena_births=45, arena_living=16, deaths=35, simulated_s=125.0)
    text = read_page(with_columns(given, "runs", islands=[1, 4, 1])).text
    assert (
        "soft, run 1, seed 7: 45 of 60 robots were born in arenas, in 2 min 05 s of "
        "simulated time, 35 died, 16 were alive at the last birth." in text
    )
    assert "A run of several islands counts with the mean of their means." in text


def test_dots_are_in_the_order_of_birth_and_of_robots_that_did_not_fail() -> None:
    # As the founders of an arena: the one of the greatest number is born first.
    given = with_columns(tables(), "robots", births=[3, 2, 1] * 3)
    text = read_page(given).text
    for number, count in ((0, 0), (1, 1), (2, 2)):  # those of the last population, too
        assert text.count(f"robot 0:{number}, soft, run 1") == count
    given = with_columns(given, "robots", is_failed=[False, False, True] * 3)
    assert read_page(given).text.count("robot 0:1, soft, run 1") == 2


def test_dots_over_births_are_at_the_greatest_fitness_of_robots() -> None:
    doubled = pc.multiply(tables()["robots"]["fitness"], 2.0).to_pylist()
    text = read_page(with_columns(tables(), "robots", fitness_max=doubled)).text
    assert text.count("robot 0:2, soft, run 1, seed 7 fitness 0.6;") == 1
    assert text.count("robot 0:2, soft, run 1, seed 7 fitness 0.3;") == 1
    assert "In arenas" not in text


def test_findings_are_folded_unless_one_is_tested(read: Reader) -> None:
    assert "What the measures mean" in read.folds
    assert "All 2 findings" in read.unfolded
    given = tables()
    given["findings"] = given["findings"].slice(1)
    others = read_page(given)
    assert "None of the 1 findings can be tested" in others.text
    assert "All 1 findings" in others.folds
    assert "All 1 findings" not in others.unfolded


def test_a_report_without_runs_has_no_empty_sections() -> None:
    empty = {name: table.slice(0, 0) for name, table in tables().items()}
    reader = read_page(empty)
    assert [link for link in reader.links if link != "#made"] == ["#tables"]
    assert "Left out" not in reader.text


def test_docstrings_of_own_measures_are_shown_once() -> None:
    rows = [
        {"measure": "flight", "about": "Share of samples in the air <b>[1]</b>."},
        {"measure": "energy", "about": ""},
    ]
    found = report_page._own({"named_measures": pa.Table.from_pylist(2 * rows)})
    assert found.count("<td>flight</td>") == 1
    assert "<td>Share of samples in the air &lt;b&gt;[1]&lt;/b&gt;.</td>" in found
    assert "energy" not in found
    assert report_page._own({}) == ""


def test_texts_of_plots_are_those_of_their_marks_and_escaped() -> None:
    figure, axes = plt.subplots()
    axes.plot([0, 1], [0, 1], gid="curve-0")
    axes.scatter([0, 1, 1], [1, 0, 1], gid="dots-1")
    axes.plot([0, 1], [1, 0])
    axes.set_yticks([0.0, 0.025, 0.125])
    texts = {"curve-0": "<a> & b", "dots-1": ["one", "two", "three"]}
    drawn = interactive(figure, texts, '"d"')
    titles = re.findall("<title>(.*?)</title>", drawn)
    assert sorted(titles) == ["&lt;a&gt; &amp; b", "one", "three", "two"]
    assert re.findall('<g class="(.*?)"><title>', drawn) == ["curve"]
    assert drawn.count("<g><title>") == 3
    assert 'aria-label="&quot;d&quot;"' in drawn
    for tick in ("0.000", "0.025", "0.125"):
        assert f">{tick}</text>" in drawn
    # The next figure of a page has equal ids.
    assert re.findall('<g id="', drawn) == []


VERDICTS = ("reproduced", "not reproduced", "undecided", "does not apply")


@pytest.mark.parametrize(
    ("verdicts", "headline"),
    [
        ((0, 2, 3), "1 reproduced, 0 not reproduced, 1 undecided, 1 does not apply."),
        ((1, 3, 3), "0 reproduced, 1 not reproduced, 0 undecided, 2 do not apply."),
        ((0, 0), "2 reproduced, 0 not reproduced, 0 undecided."),
    ],
)
def test_the_headline_counts_all_findings(
    verdicts: tuple[int, ...], headline: str
) -> None:
    rows = [
        {"figure": "6.2", "claim": "c", "expected": ">", "runs_a": 2, "why": "so",
         "verdict": VERDICTS[each]}
        for each in verdicts
    ]  # fmt: skip
    text = thesis.findings({"findings": table("findings", rows)})
    assert f"<b>{headline}</b>" in text


def test_each_verdict_has_a_colour_behind_its_white_text() -> None:
    style = Path(thesis.__file__).with_name("page.css").read_text("utf-8")
    for verdict in VERDICTS:
        assert re.search(rf"\.v\.{verdict.split()[0]}[ ,]", style)
