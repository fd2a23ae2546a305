"""The coordinator is killed, or freezes while another one resumes its run.

Kills of a coordinator with its own network are tested in test_equal_runs.py and
test_arena_runs.py. Here there are many kills, at arbitrary instants.
"""

import os
import re
import signal
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from coordinator.storage.compare import compare
from coordinator.storage.journal import NAME
from coordinator.storage.lock import LOCK

pytestmark = [
    pytest.mark.system,
    pytest.mark.timeout(300),
    pytest.mark.skipif(sys.platform != "linux", reason="reads /proc"),
]

Stage = Any
Fleets = Callable[..., Any]
PATIENCE_S = 120
ROOT = Path(__file__).parents[2]
MORTAL = Path(__file__).with_name("mortal.py")

SINGLES = """
name = "singles"
births = 40
[selection]
population = 8
children = 8
[simulation]
window_steps = 400
"""


@pytest.mark.slow
@pytest.mark.parametrize(("kind", "kills", "seed"), [("off", 40, 41), ("on", 20, 42)])
def test_killed_at_any_point(
    tmp_path: Path, hamlet_document: str, kind: str, kills: int, seed: int
) -> None:
    """Sixty kills in all, each at a random instant of up to half a run."""
    document = SINGLES if kind == "off" else hamlet_document
    (tmp_path / "mine.toml").write_text(document)
    done = subprocess.run(
        [sys.executable, str(MORTAL), "mine.toml", str(kills), str(seed)],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": str(ROOT)},
        capture_output=True,
        text=True,
        check=False,
        timeout=280,
    )
    sys.stdout.write(done.stdout)
    assert done.returncode == 0, done.stderr
    assert len(done.stdout.splitlines()) >= kills
    sizes = re.findall(r"at (\d+) bytes", done.stdout)
    assert len(set(sizes)) > kills // 4
    runs = sorted(tmp_path.glob("run-*"))
    assert len(runs) >= 2
    for run in runs:
        assert compare(tmp_path / "whole", run) == []


def frozen(stage: Stage, fleet_of: Fleets, undisturbed: Path, births: int) -> Any:  # noqa: ANN401 - a fleet
    """Return a fleet whose coordinator is frozen at some point of its run."""
    words = ("scenario1", "--seed", "5", "--births", str(births), "--quiet")
    fleet = fleet_of(stage, *words)
    fleet.join("judge", "analyzer")
    fleet.join("one")
    share = np.random.default_rng(43).uniform(0.2, 0.5)
    fleet.wait_for(share * (undisturbed / NAME).stat().st_size)
    fleet.coordinator.send_signal(signal.SIGSTOP)
    return fleet


def test_one_that_sleeps_still_holds_its_run(
    stage: Stage, undisturbed: Path, births: int, fleet_of: Fleets
) -> None:
    fleet = frozen(stage, fleet_of, undisturbed, births)
    said = stage.run("resume", "run", "--quiet", code=2)
    assert f"in use by process {fleet.coordinator.pid} on " in said
    assert len(said.strip().splitlines()) == 1
    fleet.coordinator.send_signal(signal.SIGCONT)
    fleet.finish()
    assert compare(undisturbed, fleet.folder) == []


@pytest.mark.parametrize("when", ["meanwhile", "afterwards"])
def test_one_that_wakes_up_replaced_stops_and_writes_nothing(
    stage: Stage, undisturbed: Path, births: int, fleet_of: Fleets, when: str
) -> None:
    """On file systems without locks the epoch detects the replacement."""
    fleet = frozen(stage, fleet_of, undisturbed, births)
    (fleet.folder / LOCK).unlink()
    second = stage.start("resume", "run", "--workers", "1", "--quiet")
    whole = (undisturbed / NAME).stat().st_size
    if when == "meanwhile":
        position = (fleet.folder / NAME).stat().st_size + 0.1 * whole
        fleet.wait_for(position)
    else:
        second.wait(PATIENCE_S)
    fleet.coordinator.send_signal(signal.SIGCONT)
    _, err = fleet.coordinator.communicate(timeout=PATIENCE_S)
    assert fleet.coordinator.returncode == 2, err
    assert "coordinator 2 has taken it over" in err
    assert "Traceback" not in err
    said = second.communicate(timeout=PATIENCE_S)
    assert second.returncode == 0, said
    assert compare(undisturbed, fleet.folder) == []
