"""Repeatability of arenas: equal runs for any number of threads and after any kill.

Kills are drawn over the whole run; each test prints the events that its kills hit.
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
from schema.tables.files import read_table
from schema.tables.segments import segments_of
from tests.system.fleet import size
from tests.system.workspace import Until

pytestmark = [pytest.mark.system, pytest.mark.timeout(600)]

Workspace = Any
Process = subprocess.Popen[str]

DT = 0.005
SNAPSHOT_STEPS = 2000
MOST_KILLS = 4


def words(out: str) -> tuple[str, ...]:
    return ("crowd.toml", "--seed", "4", "--quiet", "--out", out)


def advances(folder: Path) -> list[Advanced]:
    """Return the advances of a journal, which may be growing."""
    with TemporaryDirectory() as copied:
        shutil.copy(folder / NAME, copied)
        with Journal.open(Path(copied)) as journal:
            return [event for event in journal.replay() if isinstance(event, Advanced)]


def newest(folder: Path, table: str) -> int:
    """Return the number of a table's newest segment; -1 if it has none."""
    return max((number for number, _ in segments_of(folder, table)), default=-1)


class KillLog:
    """Events that kills interrupted, according to the undisturbed run."""

    def __init__(self, crowded_arena_run: Path) -> None:
        self.steps = [event.advance.step for event in advances(crowded_arena_run)]
        self.touching = set(
            read_table(crowded_arena_run, "touches")["sim_time_s"].to_pylist()
        )
        self.hits: list[str] = []

    def note(self, what: str, folder: Path) -> list[str]:
        """Record a kill that has just occurred; return the events that it hit."""
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
        events = ", ".join(hit) or "nothing but robots"
        sys.stdout.write(f"{what} killed at {last * DT:.0f} s: {events}\n")
        return hit


@pytest.mark.parametrize("threads", [1, 2, 4])
def test_number_of_threads_does_not_change_an_arena(
    crowded_arena_workspace: Workspace, crowded_arena_run: Path, threads: int
) -> None:
    flags = ("--workers", "1", "--threads", str(threads))
    crowded_arena_workspace.run("run", *words("run"), *flags)
    assert compare(crowded_arena_run, crowded_arena_workspace.folder / "run") == []
    filled = {name for name in TABLES if read_table(crowded_arena_run, name).num_rows}
    assert filled >= {"births", "fitness", "poses", "population", "touches", "deaths"}


class Fleet:
    """A coordinator, an analyzer and workers that can be killed."""

    def __init__(self, workspace: Workspace, until: Until) -> None:
        self.workspace = workspace
        self.folder = workspace.folder / "run"
        listen = ("--listen", "tcp/127.0.0.1:0")
        paced = (*words("run"), "--speed", "20")
        self.coordinator = workspace.start("coordinator", *paced, *listen)
        until((self.folder / "address").exists, "the coordinator listens")
        self.address = (self.folder / "address").read_text().split()[0]
        self.analyzer = workspace.start("analyzer", "--connect", self.address)
        self.workers: dict[str, Process] = {}

    def join(self, name: str) -> None:
        flags = ("--connect", self.address, "--processes", "1", "--name", name)
        self.workers[name] = self.workspace.start("worker", *flags)

    def has_reached(self, position: float) -> bool:
        """Return whether the journal exceeds a size [bytes]; check all processes."""
        for process in (self.coordinator, self.analyzer, *self.workers.values()):
            assert process.poll() is None, process.communicate()
        return size(self.folder) > position

    def kill_holder(self) -> str:
        """Kill the worker of the last advance and the parent that would restart it."""
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


@pytest.mark.long
@pytest.mark.parametrize("draw", range(3))
def test_killing_the_holder_twice_with_a_spare_worker_gives_an_equal_arena(
    crowded_arena_workspace: Workspace, crowded_arena_run: Path, until: Until, draw: int
) -> None:
    kill_log, whole = KillLog(crowded_arena_run), size(crowded_arena_run)
    shares = np.sort(np.random.default_rng(draw).uniform(0.05, 0.85, 2))
    fleet = Fleet(crowded_arena_workspace, until)
    fleet.join("w0")
    for number, share in enumerate(shares, start=1):
        fleet.join(f"w{number}")
        until(
            lambda: fleet.has_reached(share * whole),  # noqa: B023
            "the run is on its way",
        )
        name = fleet.kill_holder()
        kill_log.note(f"holder {name}", fleet.folder)
    until(lambda: fleet.coordinator.poll() is not None, "the run ends")
    assert fleet.coordinator.returncode == 0, fleet.coordinator.communicate()
    assert compare(crowded_arena_run, fleet.folder) == []
    holders = {event.provenance.agent for event in advances(fleet.folder)}
    assert len(holders) == 3


def resume_until(
    workspace: Workspace, until: Until, is_due: Callable[[], bool], what: str
) -> None:
    """Start or resume a run and kill its coordinator when a condition holds."""
    is_new = not (workspace.folder / "run" / EPOCH).exists()
    flags = ("--workers", "1", "--threads", "1")
    if is_new:
        process = workspace.start("run", *words("run"), *flags)
    else:
        process = workspace.start("resume", "run", "--quiet", *flags)
    until(lambda: is_due() or process.poll() is not None, what)
    process.send_signal(signal.SIGKILL)
    process.wait()


@pytest.mark.parametrize("draw", range(2))
def test_killed_coordinator_resumes_the_same_arena(
    crowded_arena_workspace: Workspace, crowded_arena_run: Path, until: Until, draw: int
) -> None:
    kill_log, whole = KillLog(crowded_arena_run), size(crowded_arena_run)
    folder = crowded_arena_workspace.folder / "run"
    for share in np.sort(np.random.default_rng(10 + draw).random(4)):
        least = share * whole
        resume_until(
            crowded_arena_workspace,
            until,
            lambda: bool(size(folder) > least),  # noqa: B023
            "the run is on its way",
        )
        kill_log.note("coordinator", folder)
    crowded_arena_workspace.run("resume", "run", "--workers", "1", "--quiet")
    assert compare(crowded_arena_run, folder) == []


def test_kills_in_a_cluster_a_snapshot_and_a_segment_change_give_an_equal_arena(
    crowded_arena_workspace: Workspace, crowded_arena_run: Path, until: Until
) -> None:
    """Aim kills at events that random kills may miss; repeat missed ones."""
    kill_log = KillLog(crowded_arena_run)
    folder = crowded_arena_workspace.folder / "run"

    def reached(step: int) -> Callable[[], bool]:
        checked_size = 0

        def has_reached_step() -> bool:
            nonlocal checked_size
            if size(folder) <= max(checked_size, 1000):
                return False
            checked_size = size(folder)
            return any(each.advance.step >= step for each in advances(folder))

        return has_reached_step

    def before_touch() -> Callable[[], bool]:
        touching = sorted(round(each / DT) for each in kill_log.touching)
        touch = touching[len(touching) // 3]
        return reached(max(step for step in kill_log.steps if step < touch))

    def before_snapshot() -> Callable[[], bool]:
        last = max(each.advance.step for each in advances(folder))
        pairs = zip(kill_log.steps, kill_log.steps[1:], strict=False)
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
            resume_until(crowded_arena_workspace, until, moment(), what)
            if what in kill_log.note("coordinator", folder):
                break
    assert {"merged cluster", "snapshot", "segment change"} <= set(kill_log.hits)
    crowded_arena_workspace.run("resume", "run", "--workers", "1", "--quiet")
    assert compare(crowded_arena_run, folder) == []
