"""Archipelagos are repeatable: with any number of workers and any kills."""

import os
import signal
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from coordinator.storage.compare import compare
from coordinator.storage.journal import NAME
from schema.tables.files import read_table

pytestmark = [pytest.mark.system, pytest.mark.timeout(300)]

Stage = Any
Until = Callable[[Callable[[], bool], str], None]

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

_ARENA = """
[islands.arena]
birth_interval_s = 5.0
cull_interval_s = 10.0
population_limit = 8
population_floor = 4
record_touches = true
"""

_SHARED = """
[simulation]
window_steps = 400
[selection]
population = 5
tournament_size = 2
"""

ARENAS = f"""
name = "arenas"
births = 10
{_SHARED}
[[islands]]
count = 2
{_ARENA}
[migration]
topology = "ring"
epoch = 7
epoch_s = 10.0
handling = "evict"
"""

MIXED = f"""
name = "mixed"
births = 9
{_SHARED}
[[islands]]
births = 35
[[islands]]
{_ARENA}
[migration]
topology = "ring"
epoch = 6
"""


def words(name: str, out: str) -> tuple[str, ...]:
    return f"{name}.toml", "--seed", "3", "--quiet", "--out", out


def size(folder: Path) -> int:
    journal = folder / NAME
    return journal.stat().st_size if journal.exists() else 0


class Play:
    """Runs of one experiment; the first is undisturbed."""

    def __init__(self, stage: Stage, until: Until, name: str, text: str) -> None:
        self.stage, self.until, self.name = stage, until, name
        (stage.folder / f"{name}.toml").write_text(text, encoding="utf-8")
        stage.run("run", *words(name, "calm"), "--workers", "1")
        self.calm = stage.folder / "calm"

    def resumed(self, out: str, share: float, *, workers: int) -> list[str]:
        """Kill a coordinator during a run; return what differs after its resume."""
        folder = self.stage.folder / out
        count = "--workers", str(workers)
        first = self.stage.start("run", *words(self.name, out), *count)
        self.until(
            lambda: size(folder) > share * size(self.calm) or first.poll() is not None,
            "the run is on its way",
        )
        first.kill()
        first.wait()
        self.stage.run("resume", out, "--quiet", "--workers", str(4 - workers))
        return compare(self.calm, folder)

    def bereft(self, out: str, shares: Iterator[float], *, workers: int) -> list[str]:
        """Kill all workers but one, one by one; return what differs at the end."""
        folder = self.stage.folder / out
        listen = "--listen", "tcp/127.0.0.1:0"
        coordinator = self.stage.start("coordinator", *words(self.name, out), *listen)
        self.until((folder / "address").exists, "the coordinator listens")
        address = (folder / "address").read_text().strip()
        self.stage.start("analyzer", "--connect", address)
        process_pool = [
            self.stage.start("worker", "--connect", address, "--processes", "1")
            for _ in range(workers)
        ]
        for one, share in zip(process_pool[1:], shares, strict=False):
            self.until(
                lambda share=share: (  # type: ignore[misc]
                    size(folder) > share * size(self.calm)
                    or coordinator.poll() is not None
                ),
                "the run is on its way",
            )
            # First the process that would revive the worker, stopped, then both.
            one.send_signal(signal.SIGSTOP)
            found = Path(f"/proc/{one.pid}/task/{one.pid}/children").read_text()
            for pid in (*found.split(), one.pid):
                os.kill(int(pid), signal.SIGKILL)
        self.until(lambda: coordinator.poll() is not None, "the run ends")
        assert coordinator.returncode == 0, coordinator.communicate()
        return compare(self.calm, folder)


def test_a_ring_of_eight_islands_gives_five_equal_runs(
    stage: Stage, until: Until
) -> None:
    play = Play(stage, until, "ring", RING)
    draws = np.random.default_rng(7)
    assert read_table(play.calm, "migrations").num_rows == 8 * 2 * 2
    assert play.resumed("two", draws.uniform(0.1, 0.5), workers=2) == []
    assert play.resumed("one", draws.uniform(0.5, 0.9), workers=1) == []
    shares = iter(sorted(draws.uniform(0.1, 0.9, 2)))
    assert play.bereft("three", shares, workers=3) == []
    stage.run("run", *words("ring", "three-calm"), "--workers", "3")
    assert compare(play.calm, stage.folder / "three-calm") == []


def test_two_arenas_outlive_a_worker_and_a_coordinator(
    stage: Stage, until: Until
) -> None:
    play = Play(stage, until, "arenas", ARENAS)
    draws = np.random.default_rng(8)
    moved = read_table(play.calm, "migrations")
    assert moved.num_rows > 2
    deaths = read_table(play.calm, "deaths")["reason"].to_pylist()
    assert deaths.count("migrated") == moved.num_rows
    abroad = read_table(play.calm, "poses")["birth_island"].drop_null()
    assert len(abroad)
    assert play.bereft("bereft", iter([draws.uniform(0.2, 0.8)]), workers=2) == []
    assert play.resumed("resumed", draws.uniform(0.2, 0.8), workers=2) == []


def test_an_off_line_island_and_an_arena(stage: Stage, until: Until) -> None:
    play = Play(stage, until, "mixed", MIXED)
    judged = read_table(play.calm, "evaluations")["birth_island"].drop_null()
    assert set(judged.to_pylist()) == {1}
    lived = read_table(play.calm, "fitness")["birth_island"].drop_null()
    assert set(lived.to_pylist()) == {0}
    share = np.random.default_rng(9).uniform(0.3, 0.7)
    assert play.resumed("resumed", share, workers=2) == []
