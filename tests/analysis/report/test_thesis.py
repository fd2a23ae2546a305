"""Tests of the section of the thesis's findings."""

import re
from pathlib import Path

import pytest

from analysis.report import thesis
from tests.analysis.drawn import table

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
