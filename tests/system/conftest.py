"""Whole runs as a user starts them: real processes, physics, network and disk."""

import os
import signal
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack
from pathlib import Path

import pytest

BIRTHS = 60
PATIENCE_S = 240.0


class Stage:
    """Starts the commands of one test in one folder and ends what is left."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        self._started: list[subprocess.Popen[str]] = []

    def start(self, *words: str) -> subprocess.Popen[str]:
        """Start ``revolve`` with these words and return at once."""
        process = subprocess.Popen(
            [sys.executable, "-m", "revolve", *words],
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            cwd=self.folder,
            env={**os.environ, "PYTHONPATH": str(Path(__file__).parents[2])},
        )
        self._started.append(process)
        return process

    def run(self, *words: str, code: int = 0) -> str:
        """Run ``revolve`` to its end; return what it printed, both streams."""
        process = self.start(*words)
        out, err = process.communicate(timeout=PATIENCE_S)
        assert process.returncode == code, f"{words}: {process.returncode}\n{out}{err}"
        return out + err

    def clear(self) -> None:
        """Kill whatever still runs."""
        for process in self._started:
            if process.poll() is None:
                process.send_signal(signal.SIGCONT)
                process.kill()
            process.communicate()


def wait_until(condition: Callable[[], bool], what: str) -> None:
    """Return once a condition holds; fail the test if it never does."""
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline, f"never happened: {what}"
        time.sleep(0.005)  # the interval of looking, not a wait for luck


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


@pytest.fixture(scope="session")
def undisturbed(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of a run in one process: what all others must equal."""
    stage = Stage(tmp_path_factory.mktemp("undisturbed"))
    words = ("scenario1", "--seed", "5", "--births", str(BIRTHS), "--quiet")
    stage.run("run", *words, "--in-process", "--out", "run")
    return stage.folder / "run"


CROWD = """
name = "crowd"
births = 25
[selection]
population = 8
[simulation]
warmup_steps = 600
[arena]
birth_radius_m = 0.5
record_touches = true
snapshot_interval_s = 30.0
"""
"""An arena so small that its robots are in each other's way."""


@pytest.fixture
def arena_stage(stage: Stage) -> Stage:
    """Return a stage on which ``crowd.toml`` lies."""
    (stage.folder / "crowd.toml").write_text(CROWD)
    return stage


@pytest.fixture(scope="session")
def calm(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Return the folder of an arena in one process, to which nothing happened."""
    stage = Stage(tmp_path_factory.mktemp("calm"))
    (stage.folder / "crowd.toml").write_text(CROWD)
    words = ("crowd.toml", "--seed", "4", "--quiet", "--out", "run")
    stage.run("run", *words, "--in-process", "--threads", "1")
    return stage.folder / "run"
