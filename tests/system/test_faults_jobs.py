"""Evaluations that crash their process, and workers with wrong code or results.

A plug-in causes the crashes, which depend only on the robot.
"""

import sys
from pathlib import Path

import pytest

from coordinator.storage.compare import compare
from schema.tables.files import read_table
from tests.system.fleet import Fleet
from tests.system.workspace import Workspace

pytestmark = [
    pytest.mark.system,
    pytest.mark.skipif(sys.platform != "linux", reason="reads /proc"),
]


DOCUMENT = """
name = "harm"
births = 16
[selection]
population = 8
children = 8
[simulation]
window_steps = 400
[fitness]
function = "plugged:fitness"
"""

PLUGGED = """
import os, signal, sys
from worker.fitness import thesis

def harm():
    {harm}

def fitness(track, settings):
    value = thesis(track, settings)
    # Not in the check before the run, whose tracks have other lengths.
    if {limit} < value and len(track.core_position) == 11:
        harm()
    return value
"""

HARMS = {
    "segfault": ("os.kill(os.getpid(), signal.SIGSEGV)", "SIGSEGV"),
    "exit": ("os._exit(3)", "exit with status 3"),
    "hang": ("while True: pass", "use of too much CPU time"),
    "wait": (
        "import threading; threading.Event().wait()",
        "waiting too long without use of CPU time",
    ),
}
QUARANTINED = "quarantined: ended its own process 3 times, by "


def write_plug_in(
    workspace: Workspace, harm: str = "pass", limit: float = 0.03
) -> None:
    """Write an experiment and its plug-in to the folder of the workspace."""
    (workspace.folder / "harm.toml").write_text(DOCUMENT)
    text = PLUGGED.format(harm=harm, limit=limit)
    (workspace.folder / "plugged.py").write_text(text)


def reasons(folder: Path) -> dict[int, str]:
    """Return the failure reasons by birth."""
    rows = read_table(folder, "evaluations").to_pylist()
    return {row["birth"]: row["reason"] for row in rows if row["status"] == "failed"}


ALONE = ("harm.toml", "--seed", "1", "--quiet", "--in-process")
WORDS = ("harm.toml", "--seed", "1", "--cpu-limit", "0.7", "--quiet")


@pytest.mark.parametrize("kind", sorted(HARMS))
def test_robot_that_crashes_three_processes_is_quarantined(
    workspace: Workspace, kind: str
) -> None:
    harm, cause = HARMS[kind]
    write_plug_in(workspace, harm)
    words = (*WORDS, "--wait-limit", "3") if kind == "wait" else WORDS
    output = workspace.run("run", *words, "--workers", "2", "--out", "run")
    folder = workspace.folder / "run"
    failed = reasons(folder)
    assert 1 <= len(failed) <= 3
    assert set(failed.values()) == {f"{QUARANTINED}{cause}"}
    assert read_table(folder, "births").num_rows == 16
    for birth in failed:
        assert f"birth {birth} of island 0: {QUARANTINED}{cause}" in output
    if kind == "wait":
        workspace.run("run", *words, "--workers", "1", "--out", "one")
        assert compare(folder, workspace.folder / "one") == []


@pytest.mark.long
def test_quarantine_pauses_a_run_with_that_option_and_resume_continues_it(
    workspace: Workspace,
) -> None:
    write_plug_in(workspace, HARMS["segfault"][0])
    workspace.run("run", *WORDS, "--workers", "2", "--out", "through")
    completed = workspace.folder / "through"
    words = (*WORDS[1:], "--on-quarantine", "pause")
    output = workspace.run(
        "run", "harm.toml", *words, "--workers", "2", "--out", "run", code=2
    )
    assert "quarantined" in output
    assert "resume to go on without it" in output
    for _ in reasons(completed):
        again = workspace.start("resume", "run", "--workers", "2", *words[2:])
        if again.wait(120) == 0:
            break
    assert compare(completed, workspace.folder / "run") == []


def test_workers_with_a_missing_or_different_plug_in_are_refused(
    workspace: Workspace,
) -> None:
    write_plug_in(workspace)
    workspace.run("run", *ALONE, "--out", "calm")
    fleet = Fleet(workspace, *WORDS)
    elsewhere = workspace.folder / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "plugged.py").write_text("fitness = lambda track, settings: 1.0\n")
    nowhere = workspace.folder / "nowhere"
    nowhere.mkdir()
    fleet.join("judge", "analyzer")
    lines: list[str] = []
    allows = ("--plugins", "plugged.py")
    for name, folder, flags in (
        ("without", nowhere, ()),
        ("another", elsewhere, allows),
    ):
        fleet.join(name, "worker", *flags, folder=folder)
        lines.append("")
        while "refused" not in lines[-1]:
            lines.append(fleet.coordinator.stderr.readline())
            assert lines[-1], lines
        assert f"refused: {name}-0." in lines[-1]
    assert "has no plug-in 'plugged'" in "".join(lines)
    assert "its plug-in 'plugged' differs from the coordinator's" in lines[-1]
    log = fleet.agents["without"].stderr
    assert "connected to" in log.readline()
    assert "no more jobs of it: has no plug-in 'plugged' among" in log.readline()
    fleet.join("good", "worker", *allows)
    fleet.finish()
    assert compare(workspace.folder / "calm", fleet.folder) == []


def test_disagreeing_workers_are_reported_and_stop_the_run(
    workspace: Workspace,
) -> None:
    """One worker adds a rounding error; the run resumes without it."""
    write_plug_in(workspace)
    module = workspace.folder / "plugged.py"
    drift = 'return value * (1 + 3e-16) if os.environ.get("DRIFT") else value'
    module.write_text(module.read_text().replace("return value", drift))
    workspace.run("run", *ALONE, "--out", "calm")
    fleet = Fleet(workspace, *WORDS, "--audit", "1")
    fleet.join("sound", "worker", "--plugins", "plugged")
    fleet.join("broken", "worker", "--plugins", "plugged", environment={"DRIFT": "1"})
    fleet.begin(workers=2)
    _, err = fleet.coordinator.communicate(timeout=60)
    assert fleet.coordinator.returncode == 2
    message = err.strip().splitlines()[-1]
    assert "sound-0." in message
    assert "broken-0." in message
    assert "'audits'" in message
    fleet.kill("broken")
    workspace.run("resume", "run", "--workers", "2", "--quiet", "--audit", "1")
    rows = read_table(fleet.folder, "audits").to_pylist()
    disputed = [row for row in rows if not row["agrees"]]
    assert sorted(row["worker"].split("-")[0] for row in disputed) == [
        "broken",
        "sound",
    ]
    one, other = (row["fitness"] for row in disputed)
    assert one != other
    assert one == pytest.approx(other, rel=1e-14)
    assert compare(workspace.folder / "calm", fleet.folder) == []
