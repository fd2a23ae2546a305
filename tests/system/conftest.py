"""Whole runs as a user starts them: real processes, physics, network and disk."""

import fcntl
import os
import shutil
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

from schema.agent.network import Tls
from tests.system.fleet import Fleet, make_certificate
from tests.system.stage import Stage, wait_until

BIRTHS = 60


@pytest.fixture
def stage(tmp_path: Path) -> Iterator[Stage]:
    with ExitStack() as stack:
        made = Stage(tmp_path)
        stack.callback(made.clear)
        yield made


@pytest.fixture
def until() -> Callable[[Callable[[], bool], str], None]:
    return wait_until


@pytest.fixture(scope="session")
def births() -> int:
    return BIRTHS


Once = Callable[[str, Callable[[Stage], object]], Path]


@pytest.fixture(scope="session")
def once(tmp_path_factory: pytest.TempPathFactory) -> Once:
    """Return a function that makes a folder once for all parallel test processes.

    Tests of other processes read the folder, so no test may write into it.
    """
    place = tmp_path_factory.getbasetemp()
    if "PYTEST_XDIST_WORKER" in os.environ:
        place = place.parent

    def made(name: str, make: Callable[[Stage], object]) -> Path:
        folder = place / f"once-{name}"
        with (place / f"once-{name}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not folder.exists():
                begun = folder.with_suffix(".begun")
                shutil.rmtree(begun, ignore_errors=True)
                begun.mkdir()
                make(Stage(begun))
                begun.rename(folder)
        return folder

    return made


@pytest.fixture(scope="session")
def undisturbed(once: Once) -> Path:
    """Return the folder of a run in one process: the reference for all others."""
    words = ("scenario1", "--seed", "5", "--births", str(BIRTHS), "--quiet")
    flags = ("--in-process", "--out", "run")
    return once("single", lambda stage: stage.run("run", *words, *flags)) / "run"


@pytest.fixture
def certify() -> Callable[[Path, str, str, str], Tls]:
    return make_certificate


@pytest.fixture
def fleet_of() -> type[Fleet]:
    return Fleet


CROWD = """
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
"""An arena so small that its robots are in each other's way, and half of them die."""


@pytest.fixture
def arena_stage(stage: Stage) -> Stage:
    """Return a stage on which ``crowd.toml`` lies."""
    (stage.folder / "crowd.toml").write_text(CROWD)
    return stage


def _arena(stage: Stage, file: str, document: str) -> None:
    """Run an arena in one process, undisturbed."""
    (stage.folder / file).write_text(document)
    flags = ("--seed", "4", "--quiet", "--in-process", "--threads", "1")
    stage.run("run", file, *flags, "--out", "run")


@pytest.fixture(scope="session")
def calm(once: Once) -> Path:
    """Return the folder of an undisturbed arena in one process."""
    return once("crowd", lambda stage: _arena(stage, "crowd.toml", CROWD)) / "run"


HAMLET = """
name = "hamlet"
births = 12
[selection]
population = 5
[simulation]
warmup_steps = 200
window_steps = 800
[arena]
birth_interval_s = 4.0
cull_interval_s = 8.0
sample_interval_s = 2.0
snapshot_interval_s = 6.0
birth_radius_m = 0.4
record_touches = true
"""
"""An arena for little more than half a minute, in which all happens that can."""


@pytest.fixture(scope="session")
def hamlet_document() -> str:
    return HAMLET


@pytest.fixture
def hamlet_stage(stage: Stage) -> Stage:
    """Return a stage on which ``hamlet.toml`` lies."""
    (stage.folder / "hamlet.toml").write_text(HAMLET)
    return stage


@pytest.fixture(scope="session")
def quiet_hamlet(once: Once) -> Path:
    """Return the folder of an undisturbed run of ``hamlet.toml``."""
    return once("hamlet", lambda stage: _arena(stage, "hamlet.toml", HAMLET)) / "run"
