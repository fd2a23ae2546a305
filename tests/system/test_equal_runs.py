"""Repeatability: equal runs for any number of workers and after kills and takeovers.

test_many_kills.py kills more of them; these are processes as a user starts them.
"""

import shutil
import signal
import sys
from pathlib import Path

import numpy as np
import pytest

from coordinator.storage.compare import compare
from coordinator.storage.lock import LOCK
from schema.tables.files import read_table
from tests.system.documents import SCENARIO1
from tests.system.fleet import Fleet, kill_beyond, size
from tests.system.workspace import Workspace

pytestmark = pytest.mark.system

NOISY = """name = "noisy"
[simulation]
sensor_noise = 0.1
actuator_noise = 0.05
evaluation_s = [12.0, 14.0]
[selection.reevaluation]
interval = 5
"""
DRIVES = """import numpy as np, revolve as rv

@rv.needs("outputs", "commands", "part_poses")
def drive(trace):
    height = trace.part_poses[:, :, 2].mean()
    changes = np.abs(np.diff(trace.outputs, axis=0)).sum()
    return float(height + changes + np.abs(trace.commands).sum())
"""


def test_killing_one_of_three_workers_gives_the_same_births(
    workspace: Workspace, undisturbed: Path
) -> None:
    fleet = Fleet(workspace, *SCENARIO1)
    for name in ("one", "two", "three"):
        fleet.join(name)
    fleet.join("judge", "analyzer")
    fleet.wait_for(np.random.default_rng(11).uniform(0.2, 0.7) * size(undisturbed))
    fleet.kill("two")
    fleet.finish()
    assert compare(undisturbed, fleet.folder) == []


@pytest.mark.parametrize("draw", range(2))
def test_killed_coordinator_resumes_to_the_same_births(
    workspace: Workspace, undisturbed: Path, draw: int
) -> None:
    # One kill at a random instant of each half of the run.
    share = (draw + np.random.default_rng(draw).random()) / 2
    words = (*SCENARIO1, "--out", "killed", "--workers", "2")
    folder = workspace.folder / "killed"
    kill_beyond(workspace.start("run", *words), folder, share * size(undisturbed))
    workspace.run("resume", "killed", "--workers", "2", "--quiet")
    assert compare(undisturbed, folder) == []


@pytest.mark.parametrize("section", ["", "[arena]\nbirth_interval_s = 2.0\n"])
def test_new_channels_in_measures_are_the_same_in_every_process(
    workspace: Workspace, section: str
) -> None:
    """Off-line and in an arena, whose second half is done after a stop."""
    (workspace.folder / "drives.py").write_text(DRIVES)
    (workspace.folder / "drives.toml").write_text(
        'name = "drives"\n[simulation]\nactuator_noise = 0.1\nwindow_steps = 200\n'
        f'{section}[measures]\nnames = ["drives:drive"]\n'
    )
    words = ("run", "drives.toml", "--births", "24", "--quiet")
    workspace.run(*words, "--in-process", "--out", "one")
    workspace.run(*words, "--workers", "2", "--out", "two")
    one, two = workspace.folder / "one", workspace.folder / "two"
    assert compare(one, two) == []
    table = "fitness" if section else "evaluations"
    cells = read_table(one, table, ["measures"])["measures"].to_pylist()
    values = [cell[0][1] for cell in cells if cell]
    assert len({*values}) > 10
    # As a kill leaves it: without the end of its journal.
    journal = two / "journal.bin"
    journal.write_bytes(journal.read_bytes()[: journal.stat().st_size // 2])
    (two / "state").write_text("running")
    shutil.rmtree(two / "tables")
    workspace.run("resume", "two", "--workers", "2", "--quiet")
    assert compare(one, two) == []


@pytest.mark.long
def test_noise_is_the_same_in_every_process(workspace: Workspace) -> None:
    """Compare a single process, two workers with audits, and a re-simulation."""
    (workspace.folder / "noisy.toml").write_text(NOISY)
    words = ("run", "noisy.toml", "--seed", "5", "--births", "30", "--quiet")
    workspace.run(*words, "--in-process", "--out", "one")
    workspace.run(*words, "--workers", "2", "--audit", "0.3", "--out", "two")
    one, two = workspace.folder / "one", workspace.folder / "two"
    assert compare(one, two) == []
    assert set(read_table(two, "audits")["agrees"].to_pylist()) == {True}
    reevaluations = read_table(one, "evaluations").to_pylist()
    repeated = {row["birth"] for row in reevaluations if row["trial"]}
    robots = ("--robot", "best-ever", "--robot", f"0:{min(repeated)}")
    out = workspace.run("view", "one", *robots, "--save", "a.rrd")
    assert out.count("moves as recorded, equal to the last bit") == 2
    assert "DIFFERS" not in out


PATIENCE_S = 120


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
@pytest.mark.parametrize("when", ["meanwhile", "afterwards"])
def test_continued_coordinator_exits_and_writes_nothing_after_a_takeover(
    workspace: Workspace, undisturbed: Path, when: str
) -> None:
    """The epoch detects a takeover on file systems without locks."""
    fleet = Fleet(workspace, *SCENARIO1)
    fleet.join("judge", "analyzer")
    fleet.join("one")
    share = np.random.default_rng(43).uniform(0.2, 0.5)
    fleet.wait_for(share * size(undisturbed))
    fleet.coordinator.send_signal(signal.SIGSTOP)
    assert "in use by process" in workspace.run("resume", "run", "--quiet", code=2)
    (fleet.folder / LOCK).unlink()
    second = workspace.start("resume", "run", "--workers", "1", "--quiet")
    whole = size(undisturbed)
    if when == "meanwhile":
        position = size(fleet.folder) + 0.1 * whole
        fleet.wait_for(position)
    else:
        second.wait(PATIENCE_S)
    fleet.coordinator.send_signal(signal.SIGCONT)
    _, err = fleet.coordinator.communicate(timeout=PATIENCE_S)
    assert fleet.coordinator.returncode == 2, err
    assert "coordinator 2 has taken it over" in err
    assert "Traceback" not in err
    output = second.communicate(timeout=PATIENCE_S)
    assert second.returncode == 0, output
    assert compare(undisturbed, fleet.folder) == []
