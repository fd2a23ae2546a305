"""Fixtures of the system tests: runs with real processes, physics, network, disk."""

import fcntl
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from tests.system.documents import CROWD, CROWDED_ARENA, HAMLET, SCENARIO1, SMALL_ARENA
from tests.system.workspace import Workspace


@pytest.fixture
def workspace(tmp_path: Path) -> Iterator[Workspace]:
    with ExitStack() as stack:
        made = Workspace(tmp_path)
        stack.callback(made.clear)
        yield made


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
    words = (*SCENARIO1, "--in-process", "--out", "run")
    return once("single", lambda workspace: workspace.run("run", *words)) / "run"


@pytest.fixture
def crowded_arena_workspace(workspace: Workspace) -> Workspace:
    """Return a workspace whose folder contains ``crowd.toml``."""
    (workspace.folder / "crowd.toml").write_text(CROWDED_ARENA)
    return workspace


@pytest.fixture
def small_arena_workspace(workspace: Workspace) -> Workspace:
    """Return a workspace whose folder contains ``hamlet.toml``, the small arena."""
    (workspace.folder / "hamlet.toml").write_text(SMALL_ARENA)
    return workspace


def _arena(once: Once, words: tuple[str, ...], document: str) -> Path:
    """Return the folder of an undisturbed arena, run in one process."""

    def make(workspace: Workspace) -> None:
        (workspace.folder / words[0]).write_text(document)
        flags = ("--in-process", "--threads", "1", "--out", "run")
        workspace.run("run", *words, *flags)

    return once(words[0], make) / "run"


@pytest.fixture(scope="session")
def crowded_arena_run(once: Once) -> Path:
    return _arena(once, CROWD, CROWDED_ARENA)


@pytest.fixture(scope="session")
def small_arena_run(once: Once) -> Path:
    return _arena(once, HAMLET, SMALL_ARENA)
