"""Evaluations that end their own process, and workers that do not fit the run.

The plug-in crashes, exits or hangs for some robots; it depends on the robot alone.
"""

import os
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from coordinator.storage.compare import compare
from schema.tables.files import read_table

pytestmark = [
    pytest.mark.system,
    pytest.mark.timeout(300),
    pytest.mark.skipif(sys.platform != "linux", reason="reads /proc"),
]

Stage = Any
Fleets = Callable[..., Any]
Until = Callable[[Callable[[], bool], str], None]

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
    if {limit} < value:
        harm()
    return value
"""

HARMS = {
    "segfault": ("os.kill(os.getpid(), signal.SIGSEGV)", "SIGSEGV"),
    "exit": ("os._exit(3)", "exit with status 3"),
    "hang": ("while True: pass", "use of too much CPU time"),
}
QUARANTINED = "quarantined: ended its own process 3 times, by "


def plug(stage: Stage, harm: str = "pass", limit: float = 0.03) -> None:
    """Put an experiment and its plug-in where the commands run."""
    (stage.folder / "harm.toml").write_text(DOCUMENT)
    text = PLUGGED.format(harm=harm, limit=limit)
    (stage.folder / "plugged.py").write_text(text)


def reasons(folder: Path) -> dict[int, str]:
    """Return the births that failed and why."""
    rows = read_table(folder, "evaluations").to_pylist()
    return {row["birth"]: row["reason"] for row in rows if row["status"] == "failed"}


WORDS = ("harm.toml", "--seed", "1", "--cpu-limit", "0.7", "--quiet")


@pytest.mark.parametrize("kind", sorted(HARMS))
def test_what_ends_its_process_three_times_is_quarantined(
    stage: Stage, kind: str
) -> None:
    harm, cause = HARMS[kind]
    plug(stage, harm)
    said = stage.run("run", *WORDS, "--workers", "2", "--out", "run")
    failed = reasons(stage.folder / "run")
    assert 1 <= len(failed) <= 3
    assert set(failed.values()) == {f"{QUARANTINED}{cause}"}
    births = read_table(stage.folder / "run", "births")
    assert births.num_rows == 16
    for birth in failed:
        assert f"birth {birth} of island 0: {QUARANTINED}{cause}" in said


def test_deaths_by_others_hands_count_for_nothing(stage: Stage, until: Until) -> None:
    """Kills of a worker from outside do not quarantine the robot."""
    plug(stage, "open('here', 'w').write(str(os.getpid())); signal.pause()")
    here = stage.folder / "here"
    run = stage.start("run", *WORDS, "--workers", "1", "--out", "run")
    for _ in range(4):
        until(lambda: here.exists() and here.read_text() != "", "a worker is at it")
        victim = int(here.read_text())
        here.unlink()
        os.kill(victim, signal.SIGKILL)
    until(lambda: here.exists() and here.read_text() != "", "a worker is at it")
    assert run.poll() is None
    assert reasons(stage.folder / "run") == {}
    run.kill()
    os.kill(int(here.read_text()), signal.SIGKILL)


def test_a_quarantine_pauses_a_run_that_wants_it_and_resume_goes_on(
    stage: Stage,
) -> None:
    plug(stage, HARMS["segfault"][0])
    stage.run("run", *WORDS, "--workers", "2", "--out", "through")
    through = stage.folder / "through"
    words = (*WORDS[1:], "--on-quarantine", "pause")
    said = stage.run(
        "run", "harm.toml", *words, "--workers", "2", "--out", "run", code=2
    )
    assert "quarantined" in said
    assert "resume to go on without it" in said
    for _ in reasons(through):
        again = stage.start("resume", "run", "--workers", "2", *words[2:])
        if again.wait(120) == 0:
            break
    assert compare(through, stage.folder / "run") == []


def test_a_worker_without_the_plug_in_or_with_another_is_refused_and_others_go_on(
    stage: Stage, fleet_of: Fleets
) -> None:
    plug(stage)
    stage.run("run", *WORDS, "--in-process", "--out", "calm")
    fleet = fleet_of(stage, *WORDS)
    elsewhere = stage.folder / "elsewhere"
    elsewhere.mkdir()
    (elsewhere / "plugged.py").write_text("fitness = lambda track, settings: 1.0\n")
    nowhere = stage.folder / "nowhere"
    nowhere.mkdir()
    fleet.join("judge", "analyzer")
    heard: list[str] = []
    for name, folder in (("without", nowhere), ("another", elsewhere)):
        fleet.join(name, "worker", folder=folder)
        heard.append("")
        while "refused" not in heard[-1]:
            heard.append(fleet.coordinator.stderr.readline())
            assert heard[-1], heard
        assert f"refused: {name}-0." in heard[-1]
    assert "has no plug-in 'plugged'" in "".join(heard)
    assert "its plug-in 'plugged' differs from the coordinator's" in heard[-1]
    fleet.join("good")
    fleet.finish()
    assert compare(stage.folder / "calm", fleet.folder) == []


def test_an_audit_changes_nothing_where_workers_agree(
    stage: Stage, fleet_of: Fleets, undisturbed: Path, births: int
) -> None:
    words = ("scenario1", "--seed", "5", "--births", str(births), "--quiet")
    fleet = fleet_of(stage, *words, "--audit", "0.2")
    fleet.join("one")
    fleet.join("other")
    fleet.begin(workers=2)
    fleet.finish()
    assert compare(undisturbed, fleet.folder) == []
    rows = read_table(fleet.folder, "audits").to_pylist()
    assert len(rows) >= 2 * 0.1 * births
    assert all(row["agrees"] for row in rows)
    for first, second in zip(rows[::2], rows[1::2], strict=True):
        assert first["birth"] == second["birth"]
        assert first["worker"] != second["worker"]
        assert first["fitness"] == second["fitness"]


def test_workers_that_do_not_agree_are_named_and_stop_the_run(
    stage: Stage, fleet_of: Fleets
) -> None:
    """One machine adds a small error; the run continues without that machine."""
    plug(stage)
    module = stage.folder / "plugged.py"
    drift = 'return value * (1 + 3e-16) if os.environ.get("DRIFT") else value'
    module.write_text(module.read_text().replace("return value", drift))
    stage.run("run", *WORDS, "--in-process", "--out", "calm")
    fleet = fleet_of(stage, *WORDS, "--audit", "1")
    fleet.join("sound")
    fleet.join("broken", environment={"DRIFT": "1"})
    fleet.begin(workers=2)
    _, err = fleet.coordinator.communicate(timeout=60)
    assert fleet.coordinator.returncode == 2
    told = err.strip().splitlines()[-1]
    assert "sound-0." in told
    assert "broken-0." in told
    assert "'audits'" in told
    fleet.kill("broken")
    stage.run("resume", "run", "--workers", "2", "--quiet", "--audit", "1")
    rows = read_table(fleet.folder, "audits").to_pylist()
    disputed = [row for row in rows if not row["agrees"]]
    assert sorted(row["worker"].split("-")[0] for row in disputed) == [
        "broken",
        "sound",
    ]
    one, other = (row["fitness"] for row in disputed)
    assert one != other
    assert one == pytest.approx(other, rel=1e-14)
    assert compare(stage.folder / "calm", fleet.folder) == []
