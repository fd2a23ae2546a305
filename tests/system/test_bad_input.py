"""Errors of users and systems: foreign settings, full disks, damaged journals."""

import os
import re
import shlex
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest

from coordinator.storage.compare import compare
from coordinator.storage.journal import NAME
from tests.system.documents import HAMLET, SCENARIO1
from tests.system.fleet import kill_beyond, size
from tests.system.workspace import Workspace

pytestmark = pytest.mark.system


def test_certificates_of_the_environment_are_not_those_of_a_run_in_one_process(
    workspace: Workspace,
) -> None:
    words = ("run", "scenario1", "--births", "15", "--in-process", "--quiet")
    gone = {"REVOLVE_TLS_CA": "gone"}
    process = workspace.start(*words, "--out", "x", environment=gone)
    assert process.wait(60) == 0


def _fill_the_disk(workspace: Workspace, *words: str, kilobytes: int) -> None:
    """Run on a small disk until it is full; copy the run folder to ``moved``."""
    disk = workspace.folder / "disk"
    disk.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", f"size={kilobytes}k", "tmpfs", str(disk)]
    if subprocess.run(mount, check=False).returncode:
        pytest.skip("a small disk cannot be mounted here")
    try:
        output = workspace.run("run", *words, "--out", "disk/run", code=2)
        assert "full" in output
        assert "Traceback" not in output
        shutil.copytree(disk / "run", workspace.folder / "moved")
    finally:
        subprocess.run(["umount", str(disk)], check=True)


@pytest.mark.skipif(os.geteuid() != 0, reason="mounting a small disk needs root")
@pytest.mark.parametrize("flags", [("--in-process",), ("--workers", "2")])
def test_run_resumes_after_a_full_disk(
    workspace: Workspace, undisturbed: Path, flags: tuple[str, ...]
) -> None:
    words = (*SCENARIO1, *flags)
    _fill_the_disk(workspace, *words, kilobytes=64)
    workspace.run("resume", "moved", "--quiet", *flags)
    assert compare(workspace.folder / "moved", undisturbed) == []


@pytest.mark.skipif(os.geteuid() != 0, reason="mounting a small disk needs root")
def test_arena_resumes_after_a_full_disk(
    small_arena_workspace: Workspace, small_arena_run: Path
) -> None:
    flags = ("--in-process", "--threads", "1")
    _fill_the_disk(small_arena_workspace, *HAMLET, *flags, kilobytes=120)
    small_arena_workspace.run("resume", "moved", "--quiet", *flags)
    assert compare(small_arena_workspace.folder / "moved", small_arena_run) == []


ASCII = {"LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}


def test_any_text_is_printed_in_an_encoding_that_lacks_it(workspace: Workspace) -> None:
    file = workspace.folder / "Größe" / "r.yaml"
    file.parent.mkdir()
    for words in (("random",), ("check",), ("show", "--experiment", "scenario1")):
        action, *flags = words
        process = workspace.start(
            "robot", action, "Größe/r.yaml", *flags, environment=ASCII
        )
        out, err = process.communicate(timeout=60)
        assert (process.returncode, err) == (0, "")
    assert out.startswith("r.yaml: ")
    assert "orientation 0?" in out


def test_a_run_folder_with_a_name_of_another_encoding_is_one_line(
    workspace: Workspace,
) -> None:
    words = ("run", "scenario1", "--births", "15", "--in-process", "--quiet")
    process = workspace.start(*words, "--out", "Größe", environment=ASCII)
    _, err = process.communicate(timeout=60)
    assert process.returncode == 2
    line = "text in this locale's encoding, ascii: rename it, or set PYTHONUTF8=1\n"
    assert err.endswith(line)
    assert err.count("\n") == 1


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
