"""Tests of ``revolve analyze`` on runs without drawable data."""

import argparse
from pathlib import Path
from typing import NoReturn

import numpy as np
import pyarrow as pa
import pytest

from analysis.analyze_command import analyze
from analysis.render.picture import NoPictures
from schema.tables.columns import TABLES
from schema.tables.files import parquet_path
from tests.analysis.campaign import random_bodies, write_run


def no_pictures() -> NoReturn:
    raise NoPictures("nothing draws here")


def test_an_analysis_without_figures_says_so(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    kind = TABLES["births"].field("body").type
    bodies = pa.array(random_bodies(np.random.default_rng(1), 30), kind)
    write_run(tmp_path / "run", "scenario1", 0, 30, bodies)
    parquet_path(tmp_path / "run", "scenario1", 0, "births").unlink()
    out = tmp_path / "report"
    options = argparse.Namespace(
        runs=[tmp_path / "run"], out=out, slots="parent", processes=1
    )
    assert analyze(options, ["analyze", "run"], no_pictures) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines[0] == "no population could be measured"
    text = "no figure could be drawn; see the line 'left out: figures'"
    assert f"{out / 'figures'}: {text}" in lines
    (line,) = [line for line in lines if line.startswith("left out: figures ")]
    assert "; 6.2, " in line
    assert line.count("no finished run could be measured") == 1
    analyze(options, ["analyze", "run"], no_pictures)
    first = capsys.readouterr().out.splitlines()[0]
    assert first.startswith(f"{out / 'report.html'}: replaces the report of ")
