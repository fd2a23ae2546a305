"""Tests of the report, read by an HTML parser."""

import base64
from datetime import UTC, datetime
from html.parser import HTMLParser
from pathlib import Path

import pyarrow as pa
import pytest

from analysis.figures.catalogue import DrawnFigure, Figure
from analysis.figures.report import report
from analysis.measures.outputs import schema

PICTURE = b"\x89PNG\r\n\x1a\nnothing more"
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

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        if tag not in VOID:
            self.open.append(tag)
        values = dict(attrs)
        self.sources += [values["src"] or ""] if "src" in values else []
        self.links += [values["href"] or ""] if "href" in values else []
        self.names += [values["id"] or ""] if "id" in values else []

    def handle_endtag(self, tag: str) -> None:
        assert self.open.pop() == tag

    def handle_data(self, data: str) -> None:
        self.words.append(data)

    @property
    def text(self) -> str:
        return " ".join(" ".join(self.words).split())


def tables() -> dict[str, pa.Table]:
    rows = {
        "runs": [
            {"experiment": "scenario1", "state": "finished", "births": 60, "seed": 7,
             "islands": 1, "run": 0},
            {"experiment": "scenario1", "state": "stopped", "births": 45, "seed": 7,
             "islands": 1, "run": 2},
            {"experiment": "b", "state": "finished", "births": 30, "seed": 8,
             "islands": 1, "run": 0},
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
    return {name: pa.Table.from_pylist(r, schema(name)) for name, r in rows.items()}


@pytest.fixture
def read(tmp_path: Path) -> Reader:
    (tmp_path / "one.png").write_bytes(PICTURE)
    figures = [
        DrawnFigure(
            Figure(
                number,
                f"Title {number}",
                "What & why.",
                ("outcomes", "<a> file"),
                lambda _: None,
            ),
            tmp_path / "one.png",
        )
        for number in ("6.2", "6.10")
    ]
    when = datetime(2020, 1, 1, tzinfo=UTC)
    page = report(tables(), figures, "revolve analyze runs", when, {"numpy": "9.9"})
    assert page.startswith("<!DOCTYPE html>")
    reader = Reader()
    reader.feed(page)
    assert reader.open == []
    return reader


def test_pictures_are_embedded_and_nothing_is_loaded(read: Reader) -> None:
    prefix = "data:image/png;base64,"
    assert len(read.sources) == 2
    for source in read.sources:
        assert base64.b64decode(source.removeprefix(prefix)) == PICTURE
    assert read.links == []
    assert read.names == ["figure-6.2", "figure-6.10"]
    assert (
        "Figure 6.10. Title 6.10. What & why. Source: outcomes , <a> file." in read.text
    )


def test_findings_are_shown_with_numbers_and_counts(read: Reader) -> None:
    assert "0 reproduced, 1 not reproduced, 1 undecided." in read.text
    assert "a <b> fitter > 2 / 3 0.25 – \u22121 – – 0.01 not reproduced so" in read.text
    assert "there is no finished run" in read.text


def test_runs_left_out_items_and_provenance_are_shown(read: Reader) -> None:
    assert "3 runs, 135 births; written 2020-01-01" in read.text
    assert (
        "scenario 1 1 finished, 1 not finished 45 to 60 1 7: repeats 0, 2" in read.text
    )
    assert "b 1 finished 30 1 8 Findings" in read.text
    assert "figure 6.1 no benchmark run runs/x broken & gone" in read.text
    assert "revolve analyze runs software version numpy 9.9" in read.text


def test_differing_settings_of_equal_names_are_shown_beside_their_runs() -> None:
    rows = tables()["runs"].to_pylist()
    rows[2]["differs"] = "births & all: 1 instead of 2"
    runs = pa.Table.from_pylist(rows, schema("runs"))
    reader = Reader()
    now = datetime.now(UTC)
    reader.feed(report({**tables(), "runs": runs}, [], "", now, {}))
    assert "seeds settings scenario 1" in reader.text
    assert "b 1 finished 30 1 8 births & all: 1 instead of 2 Findings" in reader.text


def test_a_report_without_runs_has_no_empty_sections() -> None:
    empty = {name: table.slice(0, 0) for name, table in tables().items()}
    page = report(empty, [], "revolve analyze", datetime.now(UTC), {})
    reader = Reader()
    reader.feed(page)
    assert reader.open == []
    assert "Left out" not in reader.text
    assert "Figures" not in reader.text
