"""Repeatability with islands: equal runs for any number of workers and any kill."""

import os
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from coordinator.storage.compare import compare
from schema.tables.files import read_table
from tests.system.documents import MIXED, SHORT_ARENA, SHORT_EVALUATIONS
from tests.system.fleet import size
from tests.system.workspace import Until

pytestmark = [pytest.mark.system, pytest.mark.timeout(300)]

Workspace = Any

RING = """
name = "ring"
births = 45
[simulation]
window_steps = 80
[[islands]]
count = 8
[migration]
topology = "ring"
epoch = 15
judge_anew = true
"""

ARENAS = f"""
name = "arenas"
births = 10
{SHORT_EVALUATIONS}
[[islands]]
count = 2
{SHORT_ARENA}
[migration]
topology = "ring"
epoch = 7
epoch_s = 10.0
handling = "evict"
"""


def words(name: str, out: str) -> tuple[str, ...]:
    return f"{name}.toml", "--seed", "3", "--quiet", "--out", out


class ComparedRuns:
    """Runs of an experiment; the first is the undisturbed reference."""

    def __init__(
        self, workspace: Workspace, until: Until, name: str, text: str
    ) -> None:
        self.workspace, self.until, self.name = workspace, until, name
        (workspace.folder / f"{name}.toml").write_text(text, encoding="utf-8")
        workspace.run("run", *words(name, "calm"), "--workers", "1")
        self.reference = workspace.folder / "calm"

    def differences_after_resume(
        self, out: str, share: float, *, workers: int
    ) -> list[str]:
        """Kill and resume a coordinator; return the differences from the reference."""
        folder = self.workspace.folder / out
        count = "--workers", str(workers)
        first = self.workspace.start("run", *words(self.name, out), *count)
        self.until(
            lambda: (
                size(folder) > share * size(self.reference) or first.poll() is not None
            ),
            "the run is on its way",
        )
        first.kill()
        first.wait()
        self.workspace.run("resume", out, "--quiet", "--workers", str(4 - workers))
        return compare(self.reference, folder)

    def differences_after_worker_kills(
        self, out: str, shares: Iterator[float], *, workers: int
    ) -> list[str]:
        """Kill all workers but one in turn; return differences from the reference."""
        folder = self.workspace.folder / out
        listen = "--listen", "tcp/127.0.0.1:0"
        coordinator = self.workspace.start(
            "coordinator", *words(self.name, out), *listen
        )
        self.until((folder / "address").exists, "the coordinator listens")
        address = (folder / "address").read_text().split()[0]
        self.workspace.start("analyzer", "--connect", address)
        process_pool = [
            self.workspace.start("worker", "--connect", address, "--processes", "1")
            for _ in range(workers)
        ]
        for process, share in zip(process_pool[1:], shares, strict=False):
            self.until(
                lambda share=share: (  # type: ignore[misc]
                    size(folder) > share * size(self.reference)
                    or coordinator.poll() is not None
                ),
                "the run is on its way",
            )
            # Stop the parent that would restart the worker, then kill both.
            process.send_signal(signal.SIGSTOP)
            found = Path(f"/proc/{process.pid}/task/{process.pid}/children").read_text()
            for pid in (*found.split(), process.pid):
                os.kill(int(pid), signal.SIGKILL)
        self.until(lambda: coordinator.poll() is not None, "the run ends")
        assert coordinator.returncode == 0, coordinator.communicate()
        return compare(self.reference, folder)


@pytest.mark.long
def test_runs_of_a_ring_of_eight_islands_are_equal(
    workspace: Workspace, until: Until
) -> None:
    runs = ComparedRuns(workspace, until, "ring", RING)
    rng = np.random.default_rng(7)
    assert read_table(runs.reference, "migrations").num_rows == 8 * 2 * 2
    assert runs.differences_after_resume("two", rng.uniform(0.1, 0.5), workers=2) == []
    assert runs.differences_after_resume("one", rng.uniform(0.5, 0.9), workers=1) == []
    shares = iter(sorted(rng.uniform(0.1, 0.9, 2)))
    assert runs.differences_after_worker_kills("three", shares, workers=3) == []
    workspace.run("run", *words("ring", "three-calm"), "--workers", "3")
    assert compare(runs.reference, workspace.folder / "three-calm") == []


@pytest.mark.long
def test_two_arenas_survive_kills_of_a_worker_and_a_coordinator(
    workspace: Workspace, until: Until
) -> None:
    runs = ComparedRuns(workspace, until, "arenas", ARENAS)
    rng = np.random.default_rng(8)
    migrations = read_table(runs.reference, "migrations")
    assert migrations.num_rows > 2
    deaths = read_table(runs.reference, "deaths")["reason"].to_pylist()
    assert deaths.count("migrated") == migrations.num_rows
    birth_islands = read_table(runs.reference, "poses")["birth_island"].drop_null()
    assert len(birth_islands)
    assert (
        runs.differences_after_worker_kills(
            "bereft", iter([rng.uniform(0.2, 0.8)]), workers=2
        )
        == []
    )
    assert (
        runs.differences_after_resume("resumed", rng.uniform(0.2, 0.8), workers=2) == []
    )


def test_off_line_island_and_arena_exchange_robots_and_resume(
    workspace: Workspace, until: Until
) -> None:
    runs = ComparedRuns(workspace, until, "mixed", MIXED)
    evaluated = read_table(runs.reference, "evaluations")["birth_island"].drop_null()
    assert set(evaluated.to_pylist()) == {1}
    immigrants = read_table(runs.reference, "fitness")["birth_island"].drop_null()
    assert set(immigrants.to_pylist()) == {0}
    share = np.random.default_rng(9).uniform(0.3, 0.7)
    assert runs.differences_after_resume("resumed", share, workers=2) == []
