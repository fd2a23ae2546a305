"""The data set of the campaign, read by Arrow and DuckDB, against docs/data."""

import shutil
from pathlib import Path

import duckdb
import pyarrow.parquet as pq
import pytest
import yaml

import revolve as rv
from docs.studies.dataset import FILES, write
from docs.studies.thesis.data import DATA
from revolve.command import main

pytestmark = pytest.mark.system

REPEATS = ("scenario1-00", "scenario3-07")
MINE = """
name = "mine"
births = 30
[simulation]
window_steps = 400
"""


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return a data set of two repeats of the campaign and of a run."""
    place = tmp_path_factory.mktemp("dataset")
    for table in (*FILES.values(), "populations", "extremities"):
        (place / "data" / table).mkdir(parents=True)
        for name in REPEATS:
            shutil.copy(DATA / table / f"{name}.parquet", place / "data" / table)
    (place / "mine.toml").write_text(MINE)
    words = ["run", str(place / "mine.toml"), "--in-process", "--quiet"]
    assert main([*words, "--out", str(place / "runs" / "first")]) == 0
    write(place / "set", [place / "runs"], place / "data")
    return place


def test_rows_are_those_of_the_campaign_and_of_the_run(folder: Path) -> None:
    robots = pq.read_table(folder / "set" / "robots.parquet").to_pylist()
    for name in REPEATS:
        kept = pq.read_table(DATA / "final" / f"{name}.parquet").to_pylist()
        same = [row for row in robots if f"{row['experiment']}-{row['run']:02}" == name]
        assert {row["source"] for row in same} == {"campaign"}
        assert [row | {key: same[number][key] for key in ("source", "robot")}
                for number, row in enumerate(kept)] == same  # fmt: skip
    mine = [row for row in robots if row["source"] == "runs"]
    best = max(mine, key=lambda row: row["fitness"])
    path = folder / "best.yaml"
    path.write_text(best["robot"])
    run = rv.Run(folder / "runs" / "first")
    assert rv.evaluate(rv.Robot.read(path), run.experiment).fitness == best["fitness"]
    assert run.best()[0] == run.robot(best["birth"])


def test_card_has_files_columns_and_runs(folder: Path) -> None:
    _, head, text = (folder / "set" / "README.md").read_text().split("---\n", 2)
    configs = yaml.safe_load(head)["configs"]
    assert [each["config_name"] for each in configs] == [*FILES]
    assert "| campaign | scenario1 | 1 | 3000 |" in text
    assert "| runs | mine | 1 | 30 |" in text
    for each in configs:
        path = folder / "set" / each["data_files"]
        for field in pq.read_schema(path):
            assert f"| `{field.name}` | {field.type} | " in text
        rows = duckdb.read_parquet(str(path)).project("source, experiment").distinct()
        assert len(rows.fetchall()) == 3
