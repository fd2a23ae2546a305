"""Damaged tables: found by readers, computed again by resume, equal afterwards."""

import json
import shutil
import signal
import subprocess
import sys
from pathlib import Path

import pytest

from coordinator.storage.compare import compare
from schema.tables.files import read_table
from schema.tables.segments import segment_path
from tests.system.conftest import Once
from tests.system.documents import SMALL_ARENA
from tests.system.flipping import flip, flips
from tests.system.workspace import Workspace, wait_until

pytestmark = pytest.mark.system

FLIPPING = Path(__file__).with_name("flipping.py")
BIRTHS = 150
CUT = 100_000
"""Length of a message that a kill cut [bytes]."""
FLAGS = ("--in-process", "--threads", "1", "--quiet")
OFFLINE = ("scenario1", "--seed", "5", "--births", str(BIRTHS))
ARENA = ("mine.toml", "--seed", "4")


def _make(workspace: Workspace, words: tuple[str, ...], table: str) -> None:
    """Make a finished run, and one of the same births that is killed."""
    workspace.run("run", *words, *FLAGS, "--out", "finished")
    whole = read_table(workspace.folder / "finished", table).num_rows
    killed = workspace.start("run", *words, *FLAGS, "--out", "killed")
    folder = workspace.folder / "killed"

    def is_half_done() -> bool:
        if not folder.is_dir() or not read_table(folder, "births").num_rows:
            return False
        return bool(2 * read_table(folder, table).num_rows > whole)

    wait_until(is_half_done, f"half of the rows of {table}")
    killed.send_signal(signal.SIGKILL)
    killed.communicate()


@pytest.fixture(scope="module")
def offline(once: Once) -> Path:
    """Return a folder with the run folders ``finished`` and ``killed``."""
    return once(
        "flip-offline", lambda workspace: _make(workspace, OFFLINE, "evaluations")
    )


@pytest.fixture(scope="module")
def arena(once: Once) -> Path:
    """Return such a folder for an arena."""

    def make(workspace: Workspace) -> None:
        (workspace.folder / "mine.toml").write_text(SMALL_ARENA)
        _make(workspace, ARENA, "poses")

    return once("flip-arena", make)


@pytest.fixture
def kinds(offline: Path, arena: Path) -> dict[str, Path]:
    return {"offline": offline, "arena": arena}


@pytest.mark.parametrize(
    ("kind", "table", "share"),
    [
        ("offline", "births", 0.3),
        ("offline", "evaluations", 0.9),
        ("arena", "poses", 0.2),
        ("arena", "births", 0.5),
    ],
)
def test_a_flipped_bit_in_a_segment_is_named_and_computed_again(
    workspace: Workspace, kinds: dict[str, Path], kind: str, table: str, share: float
) -> None:
    folder = workspace.folder / "run"
    shutil.copytree(kinds[kind] / "killed", folder)
    path = segment_path(folder, table, 0)
    flip(path, 8 * int(share * path.stat().st_size))
    output = workspace.run("status", "run")
    is_seen = table in ("births", "population")
    assert (f"{path.name}: damaged at byte" in output) == is_seen
    output = workspace.run("resume", "run", *FLAGS)
    assert f"{path.name}: damaged at byte" in output
    assert ("poses of arenas are lost; computing them again" in output) == (
        table == "poses"
    )
    assert compare(kinds[kind] / "finished", folder) == []


def test_lost_poses_are_simulated_again_by_worker_processes(
    workspace: Workspace, arena: Path
) -> None:
    folder = workspace.folder / "run"
    shutil.copytree(arena / "killed", folder)
    path = segment_path(folder, "poses", 0)
    path.write_bytes(path.read_bytes()[: path.stat().st_size // 4])
    output = workspace.run("resume", "run", "--workers", "1")
    assert "recomputing poses of run: advance " in output
    assert compare(arena / "finished", folder) == []


def test_readers_find_random_flips(kinds: dict[str, Path], tmp_path: Path) -> None:
    assert read_flipped(kinds, tmp_path, 60, 1) == 60


@pytest.mark.long
@pytest.mark.timeout(3600)
def test_readers_find_a_thousand_random_flips(
    kinds: dict[str, Path], tmp_path: Path
) -> None:
    assert read_flipped(kinds, tmp_path, 1000, 2) == 1000


def read_flipped(kinds: dict[str, Path], place: Path, count: int, seed: int) -> int:
    """Return how many of some flips a reader named; fail at a silent one or a crash."""
    folders = []
    for kind, folder in kinds.items():
        for state in ("finished", "killed"):
            folders.append(place / f"{kind}-{state}")
            shutil.copytree(folder / state, folders[-1])
        # As a kill in the middle of a write leaves it.
        for segment in folders[-1].rglob("*.arrows"):
            segment.write_bytes(segment.read_bytes() + bytes(CUT))
    done = subprocess.run(
        [sys.executable, str(FLIPPING), str(count), str(seed), *map(str, folders)],
        capture_output=True, text=True, check=True,
        env={"PYTHONPATH": str(FLIPPING.parents[2])},
    )  # fmt: skip
    sys.stdout.write(done.stdout)
    results = json.loads(done.stdout)
    assert results["bad"] == []
    named: int = results["named"]
    return named


@pytest.mark.long
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("seed", range(40))
def test_damaged_runs_resume_to_equal_runs(
    workspace: Workspace, kinds: dict[str, Path], seed: int
) -> None:
    """One flip or cut in each of 40 runs."""
    kind = ("offline", "arena")[seed % 2]
    state = ("killed", "finished")[seed // 2 % 2]
    folder = workspace.folder / "run"
    shutil.copytree(kinds[kind] / state, folder)
    ((path, bit),) = flips([folder], 1, seed)
    if seed % 5 == 4:
        path.write_bytes(path.read_bytes()[: bit // 8])
    else:
        flip(path, bit)
    workspace.run("resume", "run", *FLAGS)
    assert compare(kinds[kind] / "finished", folder) == []
