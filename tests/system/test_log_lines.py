"""Log lines of real processes."""

import json

import pytest

from tests.system.workspace import Workspace

pytestmark = pytest.mark.system

KEYS = {"time", "level", "process", "pid", "message"}


def test_all_lines_of_a_run_are_json(workspace: Workspace) -> None:
    run = ("run", "scenario1", "--births", "16", "--workers", "1", "--out", "run")
    process = workspace.start(*run, "--log-json", "--listen", "tcp/127.0.0.1:0")
    out, err = process.communicate(timeout=200)
    assert process.returncode == 0, err
    entries = [json.loads(line) for line in err.splitlines()]
    assert all(entry.keys() == KEYS for entry in entries)
    assert any("listening on tcp/" in entry["message"] for entry in entries)
    assert {entry["process"] for entry in entries} == {"coordinator"}
    assert "births" in out


def test_an_error_at_the_end_is_a_line_of_the_log(workspace: Workspace) -> None:
    words = ("coordinator", "scenario1", "--listen", "tcp/192.0.2.1:1", "--log-json")
    process = workspace.start(*words)
    _, err = process.communicate(timeout=200)
    assert process.returncode == 2
    (line,) = err.splitlines()
    entry = json.loads(line)
    assert entry["level"] == "error"
    assert "192.0.2.1" in entry["message"]
