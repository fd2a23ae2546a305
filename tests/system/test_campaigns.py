"""Campaigns as a user runs them: interrupted, killed, adopted, shared."""

import json
import signal
import socket
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import zenoh

from coordinator.storage.compare import compare
from coordinator.storage.folder import RunDetails, RunFolder, read_state
from schema.agent.network import hub_config
from schema.experiment.file import experiment_text, read_experiment
from tests.system.stage import Stage

pytestmark = [pytest.mark.system, pytest.mark.timeout(300)]

Until = Callable[[Callable[[], bool], str], None]

SHORT = """
name = "{name}"
births = 20
[selection]
population = 8
children = {children}
[simulation]
window_steps = 400
"""
"""Two seconds of each robot's life: what is tested here is not the physics."""

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
    """Return an undisturbed campaign that ran in one process."""

    def make(stage: Stage) -> None:
        _write(stage.folder)
        stage.run(*_words("all", "--in-process", "--quiet"))

    folder: Path = once("campaign", make)
    return folder / "all"


def _check_equal(whole: Path, other: Path) -> None:
    for name in NAMES:
        for repeat in range(REPEATS):
            folder = f"{name}-{repeat}"
            assert compare(whole / folder, other / folder) == [], folder


def _sizes(folder: Path) -> int:
    return sum(path.stat().st_size for path in folder.glob("*/journal.bin"))


def _make_alone(stage: Stage, path: Path, name: str, run: int) -> None:
    """Make a run in the format of an older version without environments."""
    text = experiment_text(read_experiment(str(stage.folder / f"{name}.toml")))
    document = json.loads(text)
    del document["environment"]
    with RunFolder(path, RunDetails(name, run, 7, json.dumps(document))):
        pass
    stage.run("resume", str(path), "--in-process", "--quiet")


def test_a_killed_campaign_resumes_and_adopts_existing_runs(
    stage: Stage, whole: Path, until: Until
) -> None:
    _write(stage.folder)
    campaign = stage.folder / "campaign"
    _make_alone(stage, campaign / "steady-1", "steady", 1)
    taken = campaign / "steady-1" / "journal.bin"
    before = taken.stat().st_mtime_ns
    first = stage.start(*_words("campaign", "--workers", "2"))
    share = taken.stat().st_size + 0.4 * (_sizes(whole) - taken.stat().st_size)
    until(lambda: _sizes(campaign) > share, "the campaign is on its way")
    first.send_signal(signal.SIGKILL)
    first.communicate()
    assert "stopped" in stage.run("status", "campaign")
    said = stage.run("resume", "campaign", "--workers", "1", "--quiet")
    assert "4 runs are finished" in said
    assert (
        "keeps its own number of births" not in said
    )  # it has as many births as the others
    _check_equal(whole, campaign)
    assert taken.stat().st_mtime_ns == before
    again = stage.run("resume", "campaign", "--workers", "1", "--quiet")
    assert "4 of 4 runs are already finished" in again


def test_ctrl_c_stops_all_runs_and_says_how_to_resume(
    stage: Stage, whole: Path, until: Until
) -> None:
    _write(stage.folder)
    campaign = stage.folder / "campaign"
    first = stage.start(*_words("campaign", "--workers", "2"))
    until(lambda: _sizes(campaign) > 0.3 * _sizes(whole), "the campaign is on its way")
    first.send_signal(signal.SIGINT)
    out, err = first.communicate(timeout=60)
    assert first.returncode == 130, out + err
    assert "revolve resume campaign" in err
    assert "Traceback" not in err
    there = [path.parent for path in campaign.glob("*/run.json")]
    assert {read_state(path) for path in there} <= {"stopped", "finished"}
    assert stage.run(*_words("campaign"), code=2).count("revolve resume campaign") == 1
    stage.run("resume", "campaign", "--in-process", "--quiet")
    _check_equal(whole, campaign)


def test_two_coordinators_share_the_workers_of_a_hub(stage: Stage, whole: Path) -> None:
    _write(stage.folder)
    with socket.create_server(("127.0.0.1", 0)) as free:
        address = f"tcp/127.0.0.1:{free.getsockname()[1]}"
    with zenoh.open(zenoh.Config.from_json5(hub_config((address,)))):
        users = [
            stage.start(
                "run", f"{name}.toml", "--seed", "7", "--repeats", str(REPEATS),
                "--connect", address, "--out", name,
            )
            for name in NAMES
        ]  # fmt: skip
        stage.start("analyzer", "--connect", address)
        stage.start("worker", "--connect", address, "--processes", "2")
        for user in users:
            out, err = user.communicate(timeout=200)
            assert user.returncode == 0, out + err
    for name in NAMES:
        for repeat in range(REPEATS):
            run = f"{name}-{repeat}"
            assert compare(whole / run, stage.folder / name / run) == []


def test_status_of_all_coordinators_of_a_hub(stage: Stage, until: Until) -> None:
    _write(stage.folder)
    first = stage.start("coordinator", *_words("one")[1:], "--listen", HUB)
    until((stage.folder / "one" / "address").exists, "the first one listens")
    address = (stage.folder / "one" / "address").read_text().strip()
    stage.start("coordinator", "steady.toml", "--connect", address, "--out", "two")
    until((stage.folder / "two" / "address").exists, "the second one is there")

    def told() -> str:
        text = stage.run("status", "--connect", address)
        return str(text)

    until(lambda: "two" in told() and "broods-1" in told(), "both tell")
    assert "0 workers" not in told()
    assert "0 of 4 runs finished, 0 of 80 births" in told()
    # By the folder's own coordinator: the folder alone knows nothing of time left.
    assert "left" not in stage.run("status", "one")
    stage.start("worker", "--connect", address, "--processes", "1")
    until(lambda: "1 workers, 0 analyzers" in stage.run("status", "one"), "it tells")
    assert first.poll() is None


@pytest.mark.parametrize(
    ("words", "complaint"),
    [
        (("status",), "either a folder or --connect"),
        (("status", "nowhere"), "no run and no campaign"),
        (("run", "thesis", "scenario1"), "must have different names"),
        (("run", "scenario1", "--repeats", "0"), "must be a whole number >= 1"),
        (("run", "scenario1", "--connect", HUB, "--listen", HUB), "exclude each other"),
        (("run", "scenario1", "--connect", "tcp/127.0.0.1:9"), "no hub"),
    ],
)
def test_errors_are_one_line(
    stage: Stage, words: tuple[str, ...], complaint: str
) -> None:
    said = stage.run(*words, code=2)
    assert complaint in said
    assert len(said.strip().splitlines()) == 1
