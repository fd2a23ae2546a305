"""Fixtures of the system tests: runs with real processes, physics, network, disk."""

import fcntl
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from schema.agent.network import Tls
from tests.system.documents import SMALL_ARENA
from tests.system.fleet import Fleet, make_certificate
from tests.system.workspace import Workspace, wait_until

BIRTHS = 60


@pytest.fixture
def workspace(tmp_path: Path) -> Iterator[Workspace]:
    with ExitStack() as stack:
        made = Workspace(tmp_path)
        stack.callback(made.clear)
        yield made


@pytest.fixture
def until() -> Callable[[Callable[[], bool], str], None]:
    return wait_until


@pytest.fixture(scope="session")
def births() -> int:
    return BIRTHS


Once = Callable[[str, Callable[[Workspace], object]], Path]


@pytest.fixture(scope="session")
def once(tmp_path_factory: pytest.TempPathFactory) -> Once:
    """Return a function that makes a folder once per test session, by name.

    All test processes share the folder, so tests must not write into it.
    """
    parent = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        parent = parent.parent

    def made(name: str, make: Callable[[Workspace], object]) -> Path:
        folder = parent / f"once-{name}"
        with (parent / f"once-{name}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not folder.exists():
                unfinished = folder.with_suffix(".begun")
                shutil.rmtree(unfinished, ignore_errors=True)
                unfinished.mkdir()
                make(Workspace(unfinished))
                unfinished.rename(folder)
        return folder

    return made


@pytest.fixture(scope="session")
def undisturbed(once: Once) -> Path:
    """Return the folder of the reference run: undisturbed, in one process."""
    words = ("scenario1", "--seed", "5", "--births", str(BIRTHS), "--quiet")
    flags = ("--in-process", "--out", "run")
    return (
        once("single", lambda workspace: workspace.run("run", *words, *flags)) / "run"
    )


@pytest.fixture
def certify() -> Callable[[Path, str, str, str], Tls]:
    return make_certificate


@pytest.fixture
def fleet_of() -> type[Fleet]:
    return Fleet


CROWDED_ARENA = """
name = "crowd"
births = 25
[selection]
population = 8
[simulation]
warmup_steps = 600
window_steps = 1200
[arena]
birth_interval_s = 4.0
cull_interval_s = 8.0
sample_interval_s = 2.0
snapshot_interval_s = 10.0
birth_radius_m = 0.5
record_touches = true
"""
"""Small arena in which robots collide and half of them die."""


@pytest.fixture
def crowded_arena_workspace(workspace: Workspace) -> Workspace:
    """Return a workspace whose folder contains ``crowd.toml``."""
    (workspace.folder / "crowd.toml").write_text(CROWDED_ARENA)
    return workspace


def _arena(workspace: Workspace, file: str, document: str) -> None:
    """Run an arena undisturbed in one process."""
    (workspace.folder / file).write_text(document)
    flags = ("--seed", "4", "--quiet", "--in-process", "--threads", "1")
    workspace.run("run", file, *flags, "--out", "run")


@pytest.fixture(scope="session")
def crowded_arena_run(once: Once) -> Path:
    """Return the folder of the undisturbed crowded arena, run in one process."""
    return (
        once("crowd", lambda workspace: _arena(workspace, "crowd.toml", CROWDED_ARENA))
        / "run"
    )


@pytest.fixture(scope="session")
def small_arena_document() -> str:
    return SMALL_ARENA


@pytest.fixture
def small_arena_workspace(workspace: Workspace) -> Workspace:
    """Return a workspace whose folder contains ``hamlet.toml``, the small arena."""
    (workspace.folder / "hamlet.toml").write_text(SMALL_ARENA)
    return workspace


@pytest.fixture(scope="session")
def small_arena_run(once: Once) -> Path:
    """Return the folder of the undisturbed small arena, run in one process."""
    return (
        once("hamlet", lambda workspace: _arena(workspace, "hamlet.toml", SMALL_ARENA))
        / "run"
    )
