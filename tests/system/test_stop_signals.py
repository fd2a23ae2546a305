"""Signals that stop commands: how soon they end, and what they leave and say."""

import os
import signal
import sys
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from tests.system.fleet import size
from tests.system.workspace import (
    Process,
    Workspace,
    runtime_directory,
    said,
    wait_until,
)

pytestmark = [
    pytest.mark.system,
    pytest.mark.skipif(sys.platform != "linux", reason="reads /proc"),
]

LIMIT_S = 10.0
SIGNALS = (
    *(signal.SIGINT, signal.SIGTERM, signal.SIGHUP),
    *(signal.SIGUSR1, signal.SIGUSR2, signal.SIGXCPU),
)
NOWHERE = "tcp/127.0.0.1:9"

SLOW = """
name = "slow"
births = 1000
[simulation]
window_steps = 2000000
"""
"""Experiment whose evaluations take minutes."""

COMMANDS = {
    "run": ("run", "slow.toml", "--workers", "2", "--out", "run", "--quiet"),
    "in-process": ("run", "slow.toml", "--in-process", "--out", "run", "--quiet"),
    "coordinator": ("coordinator", "slow.toml", "--out", "run", "--quiet"),
    "worker": ("worker", "--processes", "2", "--connect", NOWHERE),
    "analyzer": ("analyzer", "--connect", NOWHERE),
    "hub": ("hub", "--listen", "tcp/127.0.0.1:0"),
    "bench": ("bench", "evaluate", "--robots", "10000"),
}
ADVICE = {
    "run": "to resume: revolve resume run --workers 2",
    "in-process": "to resume: revolve resume run --in-process",
    "coordinator": "to resume: revolve resume run --workers 0 --listen hub",
}


@pytest.fixture(autouse=True)
def signals_by_default() -> Iterator[None]:
    """Let the commands heed hangups, also if the tests were started under nohup."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)


def family(process: int) -> set[int]:
    """Return the processes of a session, by its leader."""
    found = set()
    for entry in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, _, _, session = entry.read_text().rpartition(")")[2].split()[:4]
        except OSError:
            continue  # it has ended
        if int(session) == process and state != "Z":
            found.add(int(entry.parent.name))
    return found


def start(workspace: Workspace, *words: str) -> Process:
    (workspace.folder / "slow.toml").write_text(SLOW)
    place = {"XDG_RUNTIME_DIR": runtime_directory(workspace.folder)}
    command = (sys.executable, "-m", "revolve", *words)
    if words[0] == "nohup":
        command = (words[0], sys.executable, "-m", "revolve", *words[1:])
    return workspace.start_command(*command, environment=place)


def wait_until_begun(folder: Path, name: str, process: Process) -> str:
    """Wait until a command does what it is to be stopped in; return what it said."""

    def is_begun() -> bool:
        if process.poll() is not None:
            return True
        size = len(family(process.pid))
        if name in ("run", "in-process"):
            journal = folder / "run" / "journal.bin"
            is_vetted = journal.exists() and journal.stat().st_size > 1000
            return is_vetted and (size >= 4 or name == "in-process")
        if name == "coordinator":
            return (folder / "run" / "address").exists()
        return _cpu_s(process.pid) > 2.0

    told: str = ""
    if name in ("worker", "analyzer", "hub"):
        told = process.stderr.readline()
        assert "no hub" in told or "listening" in told, told
    else:
        wait_until(is_begun, name)
    assert process.poll() is None, process.stderr.read()
    return told


def _cpu_s(process: int) -> float:
    times = Path(f"/proc/{process}/stat").read_text().rpartition(")")[2].split()
    return (int(times[11]) + int(times[12])) / os.sysconf("SC_CLK_TCK")


def stop(process: Process, number: int, family_before: set[int]) -> tuple[float, str]:
    """Send a signal; return the time until all processes are gone, and stderr."""
    sent_s = time.monotonic()
    process.send_signal(number)
    while family(process.pid) & family_before or process.poll() is None:
        time.sleep(0.02)  # polling interval
        if time.monotonic() - sent_s > 20:
            left = len(family(process.pid))
            pytest.fail(f"{left} processes are still there after 20 s")
    taken_s = time.monotonic() - sent_s
    _, told = process.communicate()
    return taken_s, told


def cases() -> Iterator[Any]:
    """Yield command and signal; in CI, not each command gets each signal."""
    for position, name in enumerate(COMMANDS):
        in_ci = {signal.SIGINT, SIGNALS[1 + position % 5]}
        for number in SIGNALS:
            is_short = name == "worker" or number in in_ci
            marks = () if is_short else (pytest.mark.long,)
            yield pytest.param(name, number, id=f"{name}-{number.name}", marks=marks)


@pytest.mark.parametrize(("name", "number"), [*cases()])
def test_a_signal_ends_a_command_with_its_children(
    workspace: Workspace, name: str, number: signal.Signals
) -> None:
    process = start(workspace, *COMMANDS[name])
    wait_until_begun(workspace.folder, name, process)
    taken_s, told = stop(process, number, family(process.pid))
    sys.stdout.write(f"{name} {number.name}: {taken_s:.2f} s\n{told}\n")
    assert taken_s < LIMIT_S
    assert "Traceback" not in told
    again = f"to start again: revolve {' '.join(COMMANDS[name])}"
    assert said(told)[-1] == f"stopped; {ADVICE.get(name, again)}"
    assert process.returncode in (0, 130)
    assert not family(process.pid)


def test_a_command_under_nohup_ignores_hangups(workspace: Workspace) -> None:
    process = start(workspace, "nohup", *COMMANDS["worker"])
    wait_until_begun(workspace.folder, "worker", process)
    processes = family(process.pid)
    for each in processes:
        os.kill(each, signal.SIGHUP)
    ignored = 1 << signal.SIGHUP - 1
    for each in processes:
        status = Path(f"/proc/{each}/status").read_text()
        (mask,) = (line for line in status.splitlines() if line.startswith("SigIgn"))
        assert int(mask.split()[1], 16) & ignored
    taken_s, told = stop(process, signal.SIGTERM, processes)
    assert taken_s < LIMIT_S
    assert "a worker process ended" not in told


def test_an_agent_gives_up_without_a_hub(workspace: Workspace) -> None:
    words = COMMANDS["worker"]
    output = workspace.run(*words, "--give-up-after", "1.5", code=1)
    assert said(output) == [
        f"no hub at {NOWHERE}; retrying; press Ctrl-C to stop",
        f"no hub at {NOWHERE} for 1.5 s: giving up (--give-up-after)",
    ]


def test_a_run_waits_for_a_hub_that_begins_later(workspace: Workspace) -> None:
    (workspace.folder / "slow.toml").write_text(SLOW)
    place = f"unixsock-stream/{workspace.folder}/h"
    words = ("coordinator", "slow.toml", "--connect", place, "--out", "run")
    waits = f"no hub at {place}; retrying; press Ctrl-C to stop"
    gone = f"no hub at {place} for 0.5 s: giving up (--give-up-after)"
    assert said(workspace.run(*words, "--give-up-after", "0.5", code=1)) == [
        waits,
        gone,
    ]
    stopped = workspace.start(*words, "--give-up-after", "60")
    assert said(stopped.stderr.readline()) == [waits]
    taken_s, told = stop(stopped, signal.SIGINT, family(stopped.pid))
    assert taken_s < LIMIT_S
    words = ("resume", "run", "--connect", place, "--give-up-after", "60")
    assert told.splitlines()[-1].startswith("stopped; to resume: revolve resume run")
    later = workspace.start(*words, "--quiet")
    assert said(later.stderr.readline()) == [waits]
    workspace.start("hub", "--listen", place)
    assert said(later.stderr.readline()) == [f"connected to {place}"]
    workspace.start("worker", "--connect", place)
    workspace.start("analyzer", "--connect", place)
    wait_until(lambda: size(workspace.folder / "run") > 1000, "births")


def test_a_lost_hub_is_told_once_and_its_return(workspace: Workspace) -> None:
    """A coordinator and its agents go on when the hub is back."""
    document = SLOW.replace("2000000", "120").replace("1000", "30000")
    (workspace.folder / "quick.toml").write_text(document)
    place = f"unixsock-stream/{workspace.folder}/h"
    words = ("quick.toml", "--connect", place, "--quiet", "--out", "run")
    lost = "(it ended, or the network is down); retrying; press Ctrl-C to stop"

    def hub() -> Process:
        process = workspace.start("hub", "--listen", place)
        assert "listening on" in process.stderr.readline()
        return process

    first = hub()
    coordinator = workspace.start("coordinator", *words, "--give-up-after", "8")
    agents = [
        workspace.start(role, "--connect", place, "--give-up-after", "30")
        for role in ("worker", "analyzer")
    ]
    for process in agents:
        assert said(process.stderr.readline()) == [f"connected to {place}"]
    run = workspace.folder / "run"
    wait_until(lambda: size(run) > 1000, "births")
    first.terminate()
    for process in (coordinator, *agents):
        assert said(process.stderr.readline()) == [f"no hub at {place} {lost}"]
    second, before = hub(), size(run)
    for process in (coordinator, *agents):
        assert said(process.stderr.readline()) == [f"reconnected to {place}"]
    wait_until(lambda: size(run) > before + 1000, "more births")
    second.terminate()
    assert coordinator.wait(60) == 1
    *_, last = coordinator.stderr.read().splitlines()
    again = f"revolve resume run --workers 0 --connect {place} --give-up-after 8"
    assert last.endswith(f"(--give-up-after); to resume: {again}")
