"""Tests of campaigns: interruption, kills, existing runs, a sweep, a shared hub."""

import signal
from pathlib import Path

import pytest

from coordinator.storage.compare import compare
from coordinator.storage.folder import RunFolder
from schema.experiment.file import experiment_text, read_experiment
from schema.tables.description import RunDetails, read_state
from tests.system.conftest import Once
from tests.system.workspace import Workspace, wait_until

pytestmark = pytest.mark.system

SHORT = """
name = "{name}"
births = 16
[selection]
population = 8
children = {children}
[simulation]
window_steps = 400
"""
"""Evaluations of two seconds, as these tests do not depend on the physics."""
EXPERIMENTS = {
    "steady": SHORT.format(name="steady", children=1),
    "broods": (
        SHORT.format(name="broods", children=8)
        + '[sweep]\nsettings."selection.population" = [5, 8]\n'
    ),
}
WORDS = ("run", "steady.toml", "broods.toml", "--seed", "7", "--repeats", "2", "--out")
RUNS = 6
"""Each experiment is repeated, and one has two points of a sweep."""


@pytest.fixture
def lab(workspace: Workspace) -> Workspace:
    """Return a workspace with the files of the experiments."""
    for name, text in EXPERIMENTS.items():
        (workspace.folder / f"{name}.toml").write_text(text)
    return workspace


@pytest.fixture(scope="session")
def whole(once: Once) -> Path:
    """Return the folder of an undisturbed campaign, run in one process."""

    def make(workspace: Workspace) -> None:
        for name, text in EXPERIMENTS.items():
            (workspace.folder / f"{name}.toml").write_text(text)
        workspace.run(*WORDS, "all", "--in-process", "--quiet")

    return once("campaign", make) / "all"


def _sizes(folder: Path) -> int:
    return sum(path.stat().st_size for path in folder.glob("*/journal.bin"))


def test_killed_campaign_resumes_and_includes_existing_runs(
    lab: Workspace, whole: Path
) -> None:
    campaign = lab.folder / "campaign"
    text = experiment_text(read_experiment(str(lab.folder / "steady.toml")))
    with RunFolder(campaign / "steady-1", RunDetails("steady", 1, 7, text)):
        pass
    lab.run("resume", "campaign/steady-1", "--in-process", "--quiet")
    existing = campaign / "steady-1" / "journal.bin"
    before = existing.stat()
    first = lab.start(*WORDS, "campaign", "--workers", "2")
    share = before.st_size + 0.4 * (_sizes(whole) - before.st_size)
    wait_until(lambda: _sizes(campaign) > share, "the campaign is on its way")
    first.send_signal(signal.SIGKILL)
    first.communicate()
    assert "stopped" in lab.run("status", "campaign")
    output = lab.run("resume", "campaign", "--workers", "1", "--quiet")
    assert f"{RUNS} runs finished" in output
    # It has as many births as the others.
    assert "keeps its own number of births" not in output
    assert compare(whole, campaign) == []
    assert existing.stat().st_mtime_ns == before.st_mtime_ns
    again = lab.run("resume", "campaign", "--workers", "1", "--quiet")
    assert f"{RUNS} of {RUNS} runs already finished" in again


def test_ctrl_c_stops_all_runs_and_shows_how_to_resume(
    lab: Workspace, whole: Path
) -> None:
    campaign = lab.folder / "campaign"
    first = lab.start(*WORDS, "campaign", "--workers", "2")
    wait_until(lambda: _sizes(campaign) > 0.3 * _sizes(whole), "it is on its way")
    first.send_signal(signal.SIGINT)
    out, err = first.communicate(timeout=60)
    assert first.returncode == 130, out + err
    assert "revolve resume campaign" in err
    assert "Traceback" not in err
    begun = [path.parent for path in campaign.glob("*/run.json")]
    assert {read_state(path) for path in begun} <= {"stopped", "finished"}
    again = lab.run(*WORDS, "campaign", code=2)
    assert again.count("revolve resume campaign") == 1
    lab.run("resume", "campaign", "--in-process", "--quiet")
    assert compare(whole, campaign) == []
