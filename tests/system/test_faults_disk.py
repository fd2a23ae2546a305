"""Journal that is cut or damaged: the commands in the error message repair it.

A full disk is tested in test_bad_input.py.
"""

import re
import shlex
import signal
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from coordinator.storage.compare import compare
from coordinator.storage.journal import NAME

pytestmark = [pytest.mark.system, pytest.mark.timeout(300)]

Stage = Any
Until = Callable[[Callable[[], bool], str], None]


@pytest.fixture
def half(stage: Stage, undisturbed: Path, births: int, until: Until) -> Path:
    """Return the journal of a run that was killed before its end."""
    words = ("scenario1", "--seed", "5", "--births", str(births), "--quiet")
    run = stage.start("run", *words, "--in-process", "--out", "run")
    journal: Path = stage.folder / "run" / NAME
    whole = (undisturbed / NAME).stat().st_size
    until(
        lambda: journal.exists() and journal.stat().st_size > whole // 3,
        "a third of the run",
    )
    run.send_signal(signal.SIGKILL)
    run.wait()
    return journal


def test_a_journal_that_is_cut(stage: Stage, undisturbed: Path, half: Path) -> None:
    size = half.stat().st_size
    with half.open("r+b") as file:
        file.truncate(size - int(np.random.default_rng(51).integers(1, 60)))
    said = stage.run("resume", "run", "--in-process", "--quiet")
    assert re.search(r"dropped a cut record of \d+ bytes", said)
    assert compare(undisturbed, half.parent) == []


def test_a_journal_that_is_damaged(stage: Stage, undisturbed: Path, half: Path) -> None:
    data = bytearray(half.read_bytes())
    place = int(np.random.default_rng(52).integers(len(data) // 4, len(data) // 2))
    data[place] ^= 0xFF
    half.write_bytes(data)
    said = stage.run("resume", "run", "--in-process", "--quiet", code=2)
    assert "Traceback" not in said
    told = re.search(r"damaged at byte (\d+) .*\('(truncate -s \1 [^']+)'\)", said)
    assert told is not None
    assert int(told[1]) <= place
    subprocess.run(shlex.split(told[2]), cwd=stage.folder, check=True)
    stage.run("resume", "run", "--in-process", "--quiet")
    assert compare(undisturbed, half.parent) == []
