"""Tests of the report, read by an HTML parser."""

import base64
import io
from datetime import UTC, datetime
from html.parser import HTMLParser
from pathlib import Path
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc
import pytest
from PIL import Image

from analysis.comparison.progression import progression
from analysis.figures.catalogue import DrawnFigure, Figure
from analysis.figures.family_tree import Best
from analysis.figures.figure_writer import Drawings, Film
from analysis.measures.outputs import schema
from analysis.report.page import report

FILM = b"GIF89a nothing more"
NOTHING = Drawings([], [], {}, [])
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


RUNS: list[dict[str, Any]] = [
    {"experiment": "soft", "folder": f"soft-{n}", "run": n, "seed": 7, "births": 60,
     "state": "finished", "islands": 1, "differs": "", "function": "worker.fitness:f",
     "failures": n, "duration_s": 60.0 + n}
    for n in range(2)
] + [
    {"experiment": "hard & <b>", "folder": "hard-0", "run": 0, "seed": 8, "births": 45,
     "state": "stopped", "islands": 1, "differs": "births: 1 instead of 2",
     "function": "", "failures": None, "duration_s": None},
]  # fmt: skip


def tables() -> dict[str, pa.Table]:
    rows: dict[str, list[dict[str, Any]]] = {
        "runs": RUNS,
        "populations": [
            {"experiment": run["experiment"], "folder": run["folder"], "island": 0,
             "births": births, "fitness": 0.1 * (n + 1) * births / 30,
             "fitness_best": 0.5 * n}
            for n, run in enumerate(RUNS)
            for births in (15, 30)
        ],
        "robots": [
            {"experiment": run["experiment"], "folder": run["folder"],
             "birth_island": 0, "birth": birth, "fitness": fitness,
             "is_last": birth > 0, "parts": 9, "active_joints": 3, "hidden": 2}
            for run in RUNS
            for birth, fitness in enumerate((0.2, 0.1, 0.3))
        ],
        "comparison": [
            {"measure": "fitness", "a": "hard & <b>", "b": "soft", "births": 30,
             "runs_a": 2, "runs_b": 2, "mean_a": 0.2, "mean_b": 0.15,
             "difference": 0.05, "difference_low": 0.01, "difference_high": 0.09,
             "effect": 1.0, "p": 0.3, "q": 0.4},
            {"measure": "fitness_best", "a": "hard & <b>", "b": "soft", "births": 30,
             "runs_a": 2, "runs_b": 1, "mean_a": 0.2, "mean_b": 0.15,
             "difference": -0.05, "difference_low": -0.1, "difference_high": 0.02,
             "effect": 1.0, "p": 1.0, "q": 1.0},
        ],
        "findings": [
            {"figure": "6.2", "claim": "a <b> fitter", "expected": ">", "runs_a": 2,
             "runs_b": 3, "mean_a": 0.25, "effect": -1.0, "q": 0.01,
             "verdict": "not reproduced", "why": "so"},
            {"figure": "6.3", "claim": "levels off", "expected": "<",
             "verdict": "undecided", "why": "there is no finished run"},
        ],
        "left_out": [
            {"folder": "", "what": "figure 6.1", "why": "no benchmark"},
            {"folder": "runs/x", "what": "run", "why": "broken & gone"},
        ],
    }  # fmt: skip
    found = {name: pa.Table.from_pylist(r, schema(name)) for name, r in rows.items()}
    return {**found, "progression": progression(found["populations"])}


def read_page(given: dict[str, pa.Table], drawings: Drawings = NOTHING) -> Reader:
    when = datetime(2020, 1, 1, tzinfo=UTC)
    page = report(given, drawings, "revolve analyze runs", when, {"numpy": "9.9"})
    assert page.startswith("<!DOCTYPE html>")
    reader = Reader()
    reader.feed(page)
    assert reader.open == []
    return reader


@pytest.fixture(scope="module")
def read(tmp_path_factory: pytest.TempPathFactory) -> Reader:
    folder = tmp_path_factory.mktemp("figures")
    Image.new("RGB", (1600, 160), "red").save(folder / "one.png")
    (folder / "one.gif").write_bytes(FILM)
    figures = [
        DrawnFigure(
            Figure(number, f"Title {number}", "", (source,), lambda _: None, "bodies"),
            "What & why.",
            folder / "one.png",
        )
        for number, source in (("6.9", "outcomes"), ("A", "<a> file"))
    ]
    films = [Film(Best("soft", Path("soft-1"), 0, 2, 0.3), folder / "one.gif")]
    reasons = {"hard & <b>": "no driver <x>"}
    return read_page(tables(), Drawings(figures, films, reasons, []))


def test_pictures_are_embedded_and_nothing_is_loaded(read: Reader) -> None:
    film, *figures = read.sources
    assert base64.b64decode(film.removeprefix("data:image/gif;base64,")) == FILM
    assert len(figures) == 2
    for source in figures:
        stored = base64.b64decode(source.removeprefix("data:image/webp;base64,"))
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
    assert len(read.links) == len(anchors)
    assert set(anchors) <= set(read.names)
    assert {"figure-6.2", "figure-6.3", "figure-6.9", "figure-A"} <= set(read.names)
    assert not {"islands", "diversity", "measures"} & set(anchors)


def test_summary_has_one_row_per_experiment(read: Reader) -> None:
    # Means of the last populations are 0.1, 0.2 and 0.3, the best 0, 0.5 and 1.
    assert "3 runs, 165 births; written 2020-01-01" in read.text
    assert "soft 2 finished 60 0.5 0.15 1 min 00 s 1" in read.text
    row = "hard & <b> 1 not finished 45 1 0.3 – – births: 1 instead of 2"
    assert row in read.text
    assert "fitness function worker.fitness:f." in read.text


def test_differences_have_an_interval_where_both_have_two_runs(read: Reader) -> None:
    text = "hard & <b> minus soft : +0.05 , 95 % interval 0.01 to 0.09"
    assert text in read.text
    assert "hard & <b> is fitter: the interval excludes 0" in read.text
    # One run of b is no spread of zero.
    assert "\u22120.05 (2 and 1 run, at 30 births) no interval" in read.text
    assert "0.02" not in read.text


def test_marks_tell_run_seed_and_robot(read: Reader) -> None:
    assert "soft, run 1, seed 7 mean fitness 0.2 at 30 births" in read.text
    text = "robot 0:2, soft, run 1, seed 7 fitness 0.3; 9 parts, 3 motors, 2 hidden"
    # In both plots: fitter than all before, and in the last population.
    assert read.text.count(text) == 2
    # Robot 1 is less fit than robot 0.
    assert read.text.count("robot 0:1, soft, run 1") == 1
    assert "mean of 2 runs" in read.text


def test_films_are_shown_or_the_reason_is_given(read: Reader) -> None:
    assert "soft: fitness 0.3. Robot 0:2 of soft, run 1, seed 7" in read.text
    assert "hard & <b>: no moving picture: no driver <x>" in read.text


def test_findings_are_folded_unless_one_is_tested(read: Reader) -> None:
    assert "0 reproduced, 1 not reproduced, 1 undecided." in read.text
    assert "a <b> fitter > 2 / 3 0.25 – \u22121 – – 0.01 not reproduced so" in read.text
    assert "there is no finished run" in read.text
    assert "All 2 findings" in read.unfolded
    given = tables()
    given["findings"] = given["findings"].slice(1)
    others = read_page(given)
    assert "None of the 1 findings can be tested" in others.text
    assert "All 1 findings" in others.folds
    assert "All 1 findings" not in others.unfolded


def test_runs_left_out_items_and_provenance_are_shown(read: Reader) -> None:
    assert "soft 1 7 finished 60 1 0.5 0.2 1 min 01 s 1 soft-1" in read.text
    assert "figure 6.1 no benchmark run runs/x broken & gone" in read.text
    assert "revolve analyze runs software version numpy 9.9" in read.text


def test_one_experiment_has_no_comparison() -> None:
    given = tables()
    alone = given["runs"].slice(0, 1)
    others = {"comparison": given["comparison"].slice(0, 0), "runs": alone}
    mine = {
        name: given[name].filter(pc.field("folder") == "soft-0")
        for name in ("populations", "robots")
    }
    mine["progression"] = progression(mine["populations"])
    read = read_page({**given, **mine, **others})
    assert "Difference" not in read.text
    assert "#comparison" not in read.links


def test_a_report_without_runs_has_no_empty_sections() -> None:
    empty = {name: table.slice(0, 0) for name, table in tables().items()}
    reader = read_page(empty)
    assert [link for link in reader.links if link != "#made"] == ["#tables"]
    assert "Left out" not in reader.text
