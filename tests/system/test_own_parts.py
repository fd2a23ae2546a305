"""Runs with a part type and a sensor of a user's file beside the experiment."""

import shutil
from pathlib import Path

import pytest

from coordinator.storage.compare import compare
from schema.tables.files import read_table
from tests.system.workspace import Workspace

pytestmark = [pytest.mark.system, pytest.mark.timeout(300)]

CRAWLERS = Path(__file__).parents[1] / "plugins" / "crawlers.py"
SPACE = """
[space]
part_types = [
    "schema.parts:CORE", "schema.parts:FIXED_BRICK", "crawlers:{}",
    "schema.robogen_parts:ACTIVE_WHEEL", "schema.robogen_parts:WHEEL",
    "schema.robogen_parts:IR_SENSOR",
]
max_inputs = 16
"""


def prepared(workspace: Workspace, piston: str) -> None:
    """Write the user's file and an experiment with one of its part types."""
    shutil.copy(CRAWLERS, workspace.folder)
    text = f'name = "crawlers"\n{SPACE.format(piston)}'
    (workspace.folder / "mine.toml").write_text(text)


def test_two_workers_give_the_same_births_as_one_process(workspace: Workspace) -> None:
    prepared(workspace, "PISTON")
    words = ("mine.toml", "--births", "30", "--seed", "3", "--quiet")
    workspace.run("run", *words, "--out", "one", "--in-process")
    workspace.run("run", *words, "--out", "two", "--workers", "2")
    assert compare(workspace.folder / "one", workspace.folder / "two") == []
    rows = read_table(workspace.folder / "one", "births").to_pylist()
    kinds = {part["kind"] for row in rows for part in row["body"]}
    assert {"Piston", "ActiveWheel", "Wheel", "IrSensor"} <= kinds
    judged = read_table(workspace.folder / "one", "evaluations")
    assert set(judged["status"].to_pylist()) == {"ok"}


def test_a_failing_sensor_is_a_failed_evaluation(workspace: Workspace) -> None:
    prepared(workspace, "FRAGILE")
    words = ("mine.toml", "--births", "15", "--seed", "3", "--quiet", "--in-process")
    workspace.run("run", *words, "--out", "one")
    rows = read_table(workspace.folder / "one", "evaluations").to_pylist()
    failed = [row for row in rows if row["status"] == "failed"]
    assert failed
    assert all(row["reason"].startswith("sensor Fragile of part ") for row in failed)
