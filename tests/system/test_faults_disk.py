"""Recovery from a truncated or damaged journal with the printed instructions.

test_bad_input.py tests full disks.
"""

import re
import shlex
import subprocess
from pathlib import Path

import numpy as np
import pytest

from coordinator.storage.compare import compare
from coordinator.storage.journal import NAME
from tests.system.documents import SCENARIO1
from tests.system.fleet import kill_beyond, size
from tests.system.workspace import Workspace

pytestmark = [pytest.mark.system, pytest.mark.timeout(300)]


@pytest.fixture
def partial_journal(workspace: Workspace, undisturbed: Path) -> Path:
    """Return the journal of a run that was killed after a third of it."""
    run = workspace.start("run", *SCENARIO1, "--in-process", "--out", "run")
    kill_beyond(run, workspace.folder / "run", size(undisturbed) // 3)
    return workspace.folder / "run" / NAME


def test_truncated_journal_is_repaired_by_resume(
    workspace: Workspace, undisturbed: Path, partial_journal: Path
) -> None:
    size = partial_journal.stat().st_size
    with partial_journal.open("r+b") as file:
        file.truncate(size - int(np.random.default_rng(51).integers(1, 60)))
    output = workspace.run("resume", "run", "--in-process", "--quiet")
    assert re.search(r"dropped a cut record of \d+ bytes", output)
    assert compare(undisturbed, partial_journal.parent) == []


def test_damaged_journal_is_repaired_by_the_printed_command(
    workspace: Workspace, undisturbed: Path, partial_journal: Path
) -> None:
    data = bytearray(partial_journal.read_bytes())
    position = int(np.random.default_rng(52).integers(len(data) // 4, len(data) // 2))
    data[position] ^= 0xFF
    partial_journal.write_bytes(data)
    output = workspace.run("resume", "run", "--in-process", "--quiet", code=2)
    assert "Traceback" not in output
    instruction = re.search(
        r"damaged at byte (\d+) .*\('(truncate -s \1 [^']+)'\)", output
    )
    assert instruction is not None
    assert int(instruction[1]) <= position
    subprocess.run(shlex.split(instruction[2]), cwd=workspace.folder, check=True)
    workspace.run("resume", "run", "--in-process", "--quiet")
    assert compare(undisturbed, partial_journal.parent) == []
