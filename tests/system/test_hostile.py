"""A run beside a hostile peer equals an undisturbed one, at little cost in memory.

The environment variable REVOLVE_MESSAGES is the number of messages that the peer would
send to each of two runs in the longest tests; default: 100,000. Births begin when half
of them are sent, and the peer ends with the run.
"""

import json
import os
import re
import sys
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import zenoh

from coordinator.storage.compare import compare
from schema.agent.network import client_config
from schema.agent.topics import FleetMember
from tests.hostile.decode import peak_mb
from tests.system.documents import HAMLET, SCENARIO1
from tests.system.fleet import Fleet, agent_processes
from tests.system.workspace import PATIENCE_S, Process, Workspace, wait_until

pytestmark = [
    pytest.mark.system,
    pytest.mark.skipif(sys.platform != "linux", reason="reads /proc"),
]

MOST_GROWTH_MB = 100.0
MESSAGES = int(os.environ.get("REVOLVE_MESSAGES", "100000"))
ROLES = ("coordinator", "w1", "w2", "judge", "viewer")


@dataclass(frozen=True, slots=True)
class Outcome:
    """A run that has ended: its processes' peak memory [MB], and what each wrote.

    ``hostile`` is what the hostile client sent and got, if there was one.
    """

    folder: Path
    peaks_mb: dict[str, float]
    told: dict[str, str]
    hostile: dict[str, dict[str, int]]


def note_peaks(fleet: Fleet, viewer: Process, peaks_mb: dict[str, float]) -> None:
    """Note the peak memory of all processes that there are."""
    pids = {"coordinator": [fleet.coordinator.pid], "viewer": [viewer.pid]}
    for name, process in fleet.agents.items():
        pids[name] = agent_processes(process.pid)
    for name, each in pids.items():
        for pid in each:
            try:
                peak = peak_mb(pid)
            except OSError:
                continue  # it has just ended
            peaks_mb[name] = max(peaks_mb.get(name, 0.0), peak)


def _wait_for_viewer(address: str) -> None:
    """Wait until a viewer subscribes to the news of coordinators."""
    config = zenoh.Config.from_json5(client_config(address))
    with zenoh.open(config) as session:
        key = FleetMember("default", "coordinator", "unknown").events
        publisher = session.declare_publisher(key)
        # Zenoh's stubs call the status a bool; it is an object that is always true.
        status: Callable[[], Any] = lambda: publisher.matching_status  # noqa: E731
        wait_until(lambda: bool(status().matching), "the viewer subscribes")


def outcome(workspace: Workspace, words: tuple[str, ...], messages: int) -> Outcome:
    """Run with two workers, an analyzer and a viewer, and a hostile client if wanted.

    The client sends half of the messages before the first birth.
    """
    names = [*ROLES, *(["client"] if messages else [])]
    logs = {name: workspace.folder / f"{messages}-{name}.log" for name in names}
    fleet = Fleet(workspace, *words, log=logs["coordinator"])
    for name in ("w1", "w2"):
        fleet.join(name, "worker", "--cpu-limit", "2", log=logs[name])
    fleet.begin(2, has_analyzer=False)
    recording = ("--connect", fleet.address, "--save", f"{messages}.rrd")
    viewer = workspace.start("view", *recording, log=logs["viewer"])
    _wait_for_viewer(fleet.address)
    others = {"viewer": viewer}
    if messages:
        half = workspace.folder / "half"
        client = others["client"] = workspace.start(
            *("--seed", "3", "--messages", str(messages)),
            *("--connect", fleet.address, "--progress", str(half)),
            module="tests.hostile.client",
            log=logs["client"],
        )
        # Without an analyzer but the false ones, the run goes on for as long.
        wait_until(
            lambda: half.exists() or client.poll() is not None,
            "half of the messages are sent",
            patience_s=3000.0,
        )
        assert client.poll() is None, logs["client"].read_text()
    fleet.join("judge", "analyzer", log=logs["judge"])
    peaks_mb: dict[str, float] = {}
    while not fleet.is_over:
        note_peaks(fleet, viewer, peaks_mb)
        time.sleep(0.5)  # polling interval
    for process in others.values():
        process.wait(PATIENCE_S)
    for agent in fleet.agents.values():
        agent.terminate()
        agent.wait(PATIENCE_S)
    told = {name: log.read_text("utf-8", "replace") for name, log in logs.items()}
    processes = {"coordinator": fleet.coordinator, **others, **fleet.agents}
    codes = {name: process.returncode for name, process in processes.items()}
    assert set(codes.values()) == {0}, (codes, told)
    folder = fleet.folder.rename(workspace.folder / f"run-{messages}")
    sent = told["client"].splitlines()[-1] if messages else "{}"
    return Outcome(folder, peaks_mb, told, json.loads(sent))


def check(calm: Outcome, hostile: Outcome, messages: int) -> None:
    assert compare(calm.folder, hostile.folder) == []
    for name, text in hostile.told.items():
        assert "Traceback" not in text, f"{name}: {text}"
        # Zenoh colours its own lines.
        own = [line for line in text.splitlines() if not line.startswith("\x1b[2m")]
        assert not any("\x1b" in line for line in own), name
    sent = hostile.hostile["sent"]
    growth = {
        name: round(hostile.peaks_mb[name] - calm.peaks_mb[name], 1)
        for name in ROLES
        if name in hostile.peaks_mb.keys() & calm.peaks_mb.keys()
    }
    # An analyzer or a viewer may end before its memory is read.
    assert growth.keys() >= {"coordinator", "w1", "w2"}
    sys.stdout.write(f"{json.dumps([hostile.hostile, growth], indent=1)}\n")
    assert sum(sent.values()) >= messages // 2
    assert max(growth[name] for name in growth if name != "viewer") <= MOST_GROWTH_MB
    assert re.search(r"not used: [1-9]\d* malformed", hostile.told["coordinator"])
    for name in ("w1", "w2"):
        assert re.search(r"refused \d+ requests?", hostile.told[name]), name
    assert re.search(r"dropped \d+ messages", hostile.told["viewer"])


CASES = {"off-line": SCENARIO1, "arena": HAMLET}


# Not in CI: its viewer ended with 1 in one of five runs, for a reason not found yet.
@pytest.mark.long
@pytest.mark.timeout(3600)
@pytest.mark.parametrize("messages", [2000, MESSAGES])
@pytest.mark.parametrize("words", CASES.values(), ids=CASES)
def test_hostile_messages_change_nothing(
    small_arena_workspace: Workspace, words: tuple[str, ...], messages: int
) -> None:
    calm = outcome(small_arena_workspace, words, 0)
    check(calm, outcome(small_arena_workspace, words, messages), messages)
