"""Tests of campaigns: interruption, kills, existing runs, a shared hub."""

import json
import signal
import socket
from pathlib import Path
from typing import Any

import pytest
import zenoh

from coordinator.storage.compare import compare
from coordinator.storage.folder import RunDetails, RunFolder
from schema.agent.network import hub_config
from schema.experiment.file import experiment_text, read_experiment
from schema.tables.description import read_state
from tests.system.workspace import Until, Workspace

pytestmark = [pytest.mark.system, pytest.mark.timeout(300)]


SHORT = """
name = "{name}"
births = 20
[selection]
population = 8
children = {children}
[simulation]
window_steps = 400
"""
"""Evaluations of two seconds, as these tests do not depend on the physics."""

HUB = "tcp/127.0.0.1:0"
REPEATS = 2
NAMES = ("steady", "broods")


def _write(folder: Path) -> None:
    for name, children in zip(NAMES, (1, 8), strict=True):
        text = SHORT.format(name=name, children=children)
        (folder / f"{name}.toml").write_text(text)


def _words(out: str, *more: str) -> tuple[str, ...]:
    sources = tuple(f"{name}.toml" for name in NAMES)
    return ("run", *sources, "--seed", "7", "--repeats", str(REPEATS), "--out", out,
            *more)  # fmt: skip


@pytest.fixture(scope="session")
def whole(once: Any) -> Path:  # noqa: ANN401 - the fixture
    """Return the folder of an undisturbed campaign, run in one process."""

    def make(workspace: Workspace) -> None:
        _write(workspace.folder)
        workspace.run(*_words("all", "--in-process", "--quiet"))

    folder: Path = once("campaign", make)
    return folder / "all"


def _check_equal(whole: Path, other: Path) -> None:
    for name in NAMES:
        for repeat in range(REPEATS):
            folder = f"{name}-{repeat}"
            assert compare(whole / folder, other / folder) == [], folder


def _sizes(folder: Path) -> int:
    return sum(path.stat().st_size for path in folder.glob("*/journal.bin"))


def _make_single_run(workspace: Workspace, path: Path, name: str, run: int) -> None:
    """Write a single run in the format of versions without environments."""
    text = experiment_text(read_experiment(str(workspace.folder / f"{name}.toml")))
    document = json.loads(text)
    del document["environment"]
    with RunFolder(path, RunDetails(name, run, 7, json.dumps(document))):
        pass
    workspace.run("resume", str(path), "--in-process", "--quiet")


def test_killed_campaign_resumes_and_includes_existing_runs(
    workspace: Workspace, whole: Path, until: Until
) -> None:
    _write(workspace.folder)
    campaign = workspace.folder / "campaign"
    _make_single_run(workspace, campaign / "steady-1", "steady", 1)
    existing = campaign / "steady-1" / "journal.bin"
    before = existing.stat().st_mtime_ns
    first = workspace.start(*_words("campaign", "--workers", "2"))
    share = existing.stat().st_size + 0.4 * (_sizes(whole) - existing.stat().st_size)
    until(lambda: _sizes(campaign) > share, "the campaign is on its way")
    first.send_signal(signal.SIGKILL)
    first.communicate()
    assert "stopped" in workspace.run("status", "campaign")
    output = workspace.run("resume", "campaign", "--workers", "1", "--quiet")
    assert "4 runs finished" in output
    assert (
        "keeps its own number of births" not in output
    )  # it has as many births as the others
    _check_equal(whole, campaign)
    assert existing.stat().st_mtime_ns == before
    again = workspace.run("resume", "campaign", "--workers", "1", "--quiet")
    assert "4 of 4 runs already finished" in again


def test_ctrl_c_stops_all_runs_and_shows_how_to_resume(
    workspace: Workspace, whole: Path, until: Until
) -> None:
    _write(workspace.folder)
    campaign = workspace.folder / "campaign"
    first = workspace.start(*_words("campaign", "--workers", "2"))
    until(lambda: _sizes(campaign) > 0.3 * _sizes(whole), "the campaign is on its way")
    first.send_signal(signal.SIGINT)
    out, err = first.communicate(timeout=60)
    assert first.returncode == 130, out + err
    assert "revolve resume campaign" in err
    assert "Traceback" not in err
    begun = [path.parent for path in campaign.glob("*/run.json")]
    assert {read_state(path) for path in begun} <= {"stopped", "finished"}
    assert (
        workspace.run(*_words("campaign"), code=2).count("revolve resume campaign") == 1
    )
    workspace.run("resume", "campaign", "--in-process", "--quiet")
    _check_equal(whole, campaign)


def test_later_repeats_are_those_of_a_longer_campaign(
    workspace: Workspace, whole: Path
) -> None:
    _write(workspace.folder)
    sources = tuple(f"{name}.toml" for name in NAMES)
    words = ("--seed", "7", "--first-repeat", "1", "--out", "later")
    workspace.run("run", *sources, *words, "--in-process", "--quiet")
    later = workspace.folder / "later"
    names = [f"{name}-1" for name in NAMES]
    assert sorted(path.parent.name for path in later.glob("*/run.json")) == sorted(
        names
    )
    for name in names:
        assert compare(whole / name, later / name) == []


def test_two_coordinators_share_the_workers_of_a_hub(
    workspace: Workspace, whole: Path
) -> None:
    _write(workspace.folder)
    with socket.create_server(("127.0.0.1", 0)) as server:
        address = f"tcp/127.0.0.1:{server.getsockname()[1]}"
    with zenoh.open(zenoh.Config.from_json5(hub_config((address,)))):
        commands = [
            workspace.start(
                "run", f"{name}.toml", "--seed", "7", "--repeats", str(REPEATS),
                "--connect", address, "--out", name,
            )
            for name in NAMES
        ]  # fmt: skip
        workspace.start("analyzer", "--connect", address)
        workspace.start("worker", "--connect", address, "--processes", "2")
        for command in commands:
            out, err = command.communicate(timeout=200)
            assert command.returncode == 0, out + err
    for name in NAMES:
        for repeat in range(REPEATS):
            run = f"{name}-{repeat}"
            assert compare(whole / run, workspace.folder / name / run) == []


def test_status_of_all_coordinators_of_a_hub(
    workspace: Workspace, until: Until
) -> None:
    _write(workspace.folder)
    first = workspace.start("coordinator", *_words("one")[1:], "--listen", HUB)
    until((workspace.folder / "one" / "address").exists, "the first one listens")
    address = (workspace.folder / "one" / "address").read_text().split()[0]
    workspace.start("coordinator", "steady.toml", "--connect", address, "--out", "two")
    until((workspace.folder / "two" / "address").exists, "the second one is connected")

    def status() -> str:
        text = workspace.run("status", "--connect", address)
        return str(text)

    until(
        lambda: "two" in status() and "broods-1" in status(), "both coordinators answer"
    )
    assert "0 workers" not in status()
    assert "0 of 4 runs finished, 0 of 80 births" in status()
    # The folder's own coordinator answers; a folder alone has no estimate of time left.
    assert "left" not in workspace.run("status", "one")
    workspace.start("worker", "--connect", address, "--processes", "1")
    until(
        lambda: "1 worker, 0 analyzers" in workspace.run("status", "one"), "it answers"
    )
    assert first.poll() is None


def test_killed_sweep_resumes(workspace: Workspace, until: Until) -> None:
    text = SHORT.format(name="sizes", children=1)
    settings = 'settings."selection.population" = [5, 8]'
    (workspace.folder / "sizes.toml").write_text(f"{text}[sweep]\n{settings}\n")
    words = ("run", "sizes.toml", "--seed", "7", "--in-process", "--quiet", "--out")
    assert "2 runs finished" in workspace.run(*words, "all")
    whole, killed = workspace.folder / "all", workspace.folder / "killed"
    first = workspace.start(*words, "killed")
    until(lambda: _sizes(killed) > 0.4 * _sizes(whole), "the sweep is on its way")
    first.send_signal(signal.SIGKILL)
    first.communicate()
    workspace.run("resume", "killed", "--in-process", "--quiet")
    for name in ("sizes-0-0", "sizes-1-0"):
        assert compare(whole / name, killed / name) == []
