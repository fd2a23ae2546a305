"""Arenas are repeatable: with any number of threads, and after any kills.

Kills are drawn over the whole run; each test prints what its kills hit.
"""

import os
import shutil
import signal
import subprocess
import sys
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest

from coordinator.islands.events import Advanced
from coordinator.storage.compare import compare
from coordinator.storage.folder import EPOCH
from coordinator.storage.journal import NAME, Journal
from schema.tables.columns import TABLES
from schema.tables.files import read_table, segments_of

pytestmark = [pytest.mark.system, pytest.mark.timeout(600)]

Stage = Any
Process = subprocess.Popen[str]
Until = Callable[[Callable[[], bool], str], None]

DT = 0.005
SNAPSHOT_STEPS = 2000
MOST_KILLS = 4


def words(out: str) -> tuple[str, ...]:
    return ("crowd.toml", "--seed", "4", "--quiet", "--out", out)


def size(folder: Path) -> int:
    journal = folder / NAME
    return journal.stat().st_size if journal.exists() else 0


def advances(folder: Path) -> list[Advanced]:
    """Return the advances of a journal, which may be growing."""
    with TemporaryDirectory() as copied:
        shutil.copy(folder / NAME, copied)
        with Journal.open(Path(copied)) as journal:
            return [event for event in journal.replay() if isinstance(event, Advanced)]


def newest(folder: Path, table: str) -> int:
    """Return the number of a table's last segment; -1 if it has none."""
    return max((number for number, _ in segments_of(folder, table)), default=-1)


class Tally:
    """Statistics of kills: what the undisturbed run did at those times."""

    def __init__(self, calm: Path) -> None:
        self.steps = [event.advance.step for event in advances(calm)]
        self.touching = set(read_table(calm, "touches")["sim_time_s"].to_pylist())
        self.hits: list[str] = []

    def note(self, what: str, folder: Path) -> list[str]:
        """Record a kill; return what it hit."""
        last = max((event.advance.step for event in advances(folder)), default=0)
        following = min((step for step in self.steps if step > last), default=last)
        hit = []
        if round(following * DT, 6) in {round(each, 6) for each in self.touching}:
            hit.append("merged cluster")
        if following // SNAPSHOT_STEPS > last // SNAPSHOT_STEPS:
            hit.append("snapshot")
        # Poses are written before the journal, fitness at the next flush.
        last_poses, last_fitness = newest(folder, "poses"), newest(folder, "fitness")
        if what == "coordinator" and last_poses != last_fitness:
            hit.append("segment change")
        self.hits += hit
        told = ", ".join(hit) or "nothing but robots"
        sys.stdout.write(f"{what} killed at {last * DT:.0f} s: {told}\n")
        return hit


@pytest.mark.parametrize("threads", [1, 2, 4])
def test_threads_change_nothing(arena_stage: Stage, calm: Path, threads: int) -> None:
    flags = ("--workers", "1", "--threads", str(threads))
    arena_stage.run("run", *words("run"), *flags)
    assert compare(calm, arena_stage.folder / "run") == []
    filled = {name for name in TABLES if read_table(calm, name).num_rows}
    assert filled >= {"births", "fitness", "poses", "population", "touches", "deaths"}


class Fleet:
    """A coordinator, an analyzer and workers that can be killed."""

    def __init__(self, stage: Stage, until: Until) -> None:
        self.stage = stage
        self.folder = stage.folder / "run"
        listen = ("--listen", "tcp/127.0.0.1:0")
        paced = (*words("run"), "--speed", "20")
        self.coordinator = stage.start("coordinator", *paced, *listen)
        until((self.folder / "address").exists, "the coordinator listens")
        self.address = (self.folder / "address").read_text().strip()
        self.analyzer = stage.start("analyzer", "--connect", self.address)
        self.workers: dict[str, Process] = {}

    def join(self, name: str) -> None:
        flags = ("--connect", self.address, "--processes", "1", "--name", name)
        self.workers[name] = self.stage.start("worker", *flags)

    def has_come_to(self, position: float) -> bool:
        """Return whether the journal has a size [bytes]; all must be alive."""
        for process in (self.coordinator, self.analyzer, *self.workers.values()):
            assert process.poll() is None, process.communicate()
        return size(self.folder) > position

    def kill_holder(self) -> str:
        """Kill the worker of the last advance, and its supervisor."""
        agent = advances(self.folder)[-1].provenance.agent
        name = agent.partition("-")[0]
        process_pool = self.workers.pop(name)
        process_pool.send_signal(signal.SIGSTOP)
        for child in children(process_pool.pid):
            with suppress(ProcessLookupError):
                os.kill(child, signal.SIGKILL)
        process_pool.send_signal(signal.SIGKILL)
        return name


def children(pid: int) -> list[int]:
    text = Path(f"/proc/{pid}/task/{pid}/children").read_text()
    return [int(each) for each in text.split()]


@pytest.mark.parametrize("draw", range(3))
def test_holder_killed_twice_while_another_stands_by(
    arena_stage: Stage, calm: Path, until: Until, draw: int
) -> None:
    tally, whole = Tally(calm), size(calm)
    shares = np.sort(np.random.default_rng(draw).uniform(0.05, 0.85, 2))
    fleet = Fleet(arena_stage, until)
    fleet.join("w0")
    for number, share in enumerate(shares, start=1):
        fleet.join(f"w{number}")
        until(
            lambda: fleet.has_come_to(share * whole),  # noqa: B023
            "the run is on its way",
        )
        name = fleet.kill_holder()
        tally.note(f"holder {name}", fleet.folder)
    until(lambda: fleet.coordinator.poll() is not None, "the run ends")
    assert fleet.coordinator.returncode == 0, fleet.coordinator.communicate()
    assert compare(calm, fleet.folder) == []
    holders = {event.provenance.agent for event in advances(fleet.folder)}
    assert len(holders) == 3


def resume_until(
    stage: Stage, until: Until, is_time: Callable[[], bool], what: str
) -> None:
    """Start or resume a run, and kill its coordinator when a condition holds."""
    is_new = not (stage.folder / "run" / EPOCH).exists()
    flags = ("--workers", "1", "--threads", "1")
    if is_new:
        process = stage.start("run", *words("run"), *flags)
    else:
        process = stage.start("resume", "run", "--quiet", *flags)
    until(lambda: is_time() or process.poll() is not None, what)
    process.send_signal(signal.SIGKILL)
    process.wait()


@pytest.mark.parametrize("draw", range(2))
def test_killed_coordinator_resumes_the_same_arena(
    arena_stage: Stage, calm: Path, until: Until, draw: int
) -> None:
    tally, whole = Tally(calm), size(calm)
    folder = arena_stage.folder / "run"
    for share in np.sort(np.random.default_rng(10 + draw).random(4)):
        enough = share * whole
        resume_until(
            arena_stage,
            until,
            lambda: bool(size(folder) > enough),  # noqa: B023
            "the run is on its way",
        )
        tally.note("coordinator", folder)
    arena_stage.run("resume", "run", "--workers", "1", "--quiet")
    assert compare(calm, folder) == []


def test_killed_in_a_cluster_a_snapshot_and_a_segment_change(
    arena_stage: Stage, calm: Path, until: Until
) -> None:
    """Kill at chosen moments that random kills may miss; retry if one is missed."""
    tally = Tally(calm)
    folder = arena_stage.folder / "run"

    def reached(step: int) -> Callable[[], bool]:
        looked_at = 0

        def is_there() -> bool:
            nonlocal looked_at
            if size(folder) <= max(looked_at, 1000):
                return False
            looked_at = size(folder)
            return any(each.advance.step >= step for each in advances(folder))

        return is_there

    def before_touch() -> Callable[[], bool]:
        touching = sorted(round(each / DT) for each in tally.touching)
        touch = touching[len(touching) // 3]
        return reached(max(step for step in tally.steps if step < touch))

    def before_snapshot() -> Callable[[], bool]:
        last = max(each.advance.step for each in advances(folder))
        pairs = zip(tally.steps, tally.steps[1:], strict=False)
        return reached(
            next(
                step for step, following in pairs
                if step > last
                and following // SNAPSHOT_STEPS > step // SNAPSHOT_STEPS
            )
        )  # fmt: skip

    def new_segment() -> Callable[[], bool]:
        known = {table: newest(folder, table) for table in ("poses", "fitness")}
        return lambda: any(newest(folder, table) > known[table] for table in known)

    for what, moment in (
        ("merged cluster", before_touch),
        ("snapshot", before_snapshot),
        ("segment change", new_segment),
    ):
        for _ in range(MOST_KILLS):
            resume_until(arena_stage, until, moment(), what)
            if what in tally.note("coordinator", folder):
                break
    assert {"merged cluster", "snapshot", "segment change"} <= set(tally.hits)
    arena_stage.run("resume", "run", "--workers", "1", "--quiet")
    assert compare(calm, folder) == []
