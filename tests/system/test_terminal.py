"""What a user meets whose terminal, or what stands in its place, does odd things."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

import revolve

pytestmark = pytest.mark.system

ROOT = Path(__file__).parents[2]
Stage = Any


def _start(*words: str) -> subprocess.Popen[str]:
    """Start a command as a shell does: as the head of a process group."""
    return subprocess.Popen(
        [sys.executable, "-m", "revolve", *words],
        stderr=subprocess.PIPE,
        text=True,
        cwd=ROOT,
        start_new_session=True,
    )


@pytest.mark.parametrize("awaited", ["run.json", "address"])
def test_ctrl_c_pressed_twice_while_processes_start(
    stage: Stage, until: Callable[[Callable[[], bool], str], None], awaited: str
) -> None:
    """It reaches the whole group: they import yet, or do not wait for it yet."""
    run = stage.folder / "run"
    process = _start("run", "scenario1", "--out", str(run))
    until((run / awaited).exists, awaited)
    os.killpg(process.pid, signal.SIGINT)
    time.sleep(0.1)  # as a finger does; nothing is waited for
    os.killpg(process.pid, signal.SIGINT)
    _, said = process.communicate(timeout=60)
    assert "Traceback" not in said
    assert f"stopped; to go on: revolve resume {run}" in said
    assert process.returncode == 130


def test_ctrl_c_while_an_engine_is_loaded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It makes an import fail that knows nothing of it."""
    (tmp_path / "engine_of_a_test.py").write_text(
        "try:\n    raise KeyboardInterrupt\n"
        "except KeyboardInterrupt as error:\n    raise ImportError('no') from error\n"
    )
    monkeypatch.syspath_prepend(tmp_path)
    monkeypatch.setitem(revolve.COMMANDS, "status", ("engine_of_a_test", "is odd"))
    assert revolve.main(["status"]) == 130
