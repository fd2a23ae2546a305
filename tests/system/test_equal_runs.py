"""Repeatability: equal runs for any number of workers and after any kill."""

import signal
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from coordinator.storage.compare import compare
from schema.tables.files import read_table
from tests.system.fleet import size
from tests.system.workspace import Until

pytestmark = [pytest.mark.system, pytest.mark.timeout(300)]

Workspace = Any


def _words(births: int, out: str) -> tuple[str, ...]:
    return (
        "scenario1", "--seed", "5", "--births", str(births), "--out", out, "--quiet",
    )  # fmt: skip


NOISY = """name = "noisy"
[simulation]
sensor_noise = 0.1
actuator_noise = 0.05
evaluation_s = [12.0, 14.0]
[selection.reevaluation]
interval = 5
"""


def test_one_worker_gives_the_same_births_as_a_single_process(
    workspace: Workspace, undisturbed: Path, births: int
) -> None:
    workspace.run("run", *_words(births, "one"), "--workers", "1")
    assert compare(undisturbed, workspace.folder / "one") == []


def test_killing_one_of_three_workers_gives_the_same_births(
    workspace: Workspace, undisturbed: Path, births: int, until: Until
) -> None:
    folder = workspace.folder / "three"
    words = _words(births, "three")
    coordinator = workspace.start("coordinator", *words, "--listen", "tcp/127.0.0.1:0")
    until((folder / "address").exists, "the coordinator listens")
    address = (folder / "address").read_text().split()[0]
    workspace.start("analyzer", "--connect", address)
    workers = [
        workspace.start("worker", "--connect", address, "--processes", "1")
        for _ in range(3)
    ]
    whole = size(undisturbed)
    share = np.random.default_rng(11).uniform(0.2, 0.7)
    until(lambda: size(folder) > share * whole, "the run is on its way")
    workers[1].send_signal(signal.SIGKILL)
    until(lambda: coordinator.poll() is not None, "the run ends")
    assert coordinator.returncode == 0, coordinator.communicate()
    assert compare(undisturbed, folder) == []


@pytest.mark.parametrize("draw", range(4))
def test_killed_coordinator_resumes_to_the_same_births(
    workspace: Workspace, undisturbed: Path, births: int, until: Until, draw: int
) -> None:
    folder = workspace.folder / "killed"
    whole = size(undisturbed)
    # One kill at a random instant of each quarter of the run.
    share = (draw + np.random.default_rng(draw).random()) / 4
    first = workspace.start("run", *_words(births, "killed"), "--workers", "2")
    until(
        lambda: size(folder) > share * whole or first.poll() is not None,
        "the run is on its way",
    )
    first.send_signal(signal.SIGKILL)
    first.wait()
    workspace.run("resume", "killed", "--workers", "2", "--quiet")
    assert compare(undisturbed, folder) == []


@pytest.mark.long
def test_noise_is_the_same_in_every_process(workspace: Workspace) -> None:
    """Compare a single process, two workers with audits, and a re-simulation."""
    (workspace.folder / "noisy.toml").write_text(NOISY)
    words = ("run", "noisy.toml", "--seed", "5", "--births", "30", "--quiet")
    workspace.run(*words, "--in-process", "--out", "one")
    workspace.run(*words, "--workers", "2", "--audit", "0.3", "--out", "two")
    one, two = workspace.folder / "one", workspace.folder / "two"
    assert compare(one, two) == []
    agrees = read_table(two, "audits")["agrees"].to_pylist()
    assert agrees
    assert all(agrees)
    reevaluations = read_table(one, "evaluations").to_pylist()
    repeated = {row["birth"] for row in reevaluations if row["trial"]}
    assert repeated
    robots = ("--robot", "best-ever", "--robot", f"0:{min(repeated)}")
    out = workspace.run("view", "one", *robots, "--save", "a.rrd")
    assert out.count("moves as recorded, equal to the last bit") == 2
    assert "DIFFERS" not in out


def test_second_coordinator_is_refused_with_the_id_of_the_first(
    workspace: Workspace, births: int, until: Until
) -> None:
    folder = workspace.folder / "held"
    first = workspace.start(
        "coordinator", *_words(births, "held"), "--listen", "tcp/127.0.0.1:0"
    )
    until((folder / "address").exists, "the coordinator listens")
    output = workspace.run("resume", "held", "--quiet", code=2)
    assert str(first.pid) in output
    assert len(output.strip().splitlines()) == 1


def test_ctrl_c_stops_cleanly_and_shows_how_to_resume(
    workspace: Workspace, undisturbed: Path, births: int, until: Until
) -> None:
    folder = workspace.folder / "stopped"
    first = workspace.start("run", *_words(births, "stopped"), "--workers", "2")
    until(lambda: size(folder) > size(undisturbed) // 3, "the run is on its way")
    first.send_signal(signal.SIGINT)
    out, err = first.communicate(timeout=60)
    assert first.returncode == 130, out + err
    assert "revolve resume stopped" in out + err
    assert "Traceback" not in err
    workspace.run("resume", "stopped", "--workers", "1", "--quiet")
    assert compare(undisturbed, folder) == []
