"""Benchmark of an arena over two workers against one, in pairs of turns.

Robots neither die nor are born once all founders live. The time is that from the last
founder's birth to the end of the run, as the journal grows.
"""

import subprocess
import sys
import time
from pathlib import Path
from statistics import mean

import pytest

from coordinator.storage.compare import compare
from tests.system.fleet import advances, size

pytestmark = [pytest.mark.benchmark, pytest.mark.timeout(3600)]

PAIRS, ROBOTS, LASTING_S = 2, 200, 60
RULES = """
import revolve as rv

class Still:
    def __init__(self, experiment, parameters):
        self.stores, self.meeting_distance_m = {}, None

    def decide(self, view, rng):
        return rv.Decisions()
"""
DOCUMENT = f"""
name = "still"
births = {ROBOTS + 1}
[selection]
population = {ROBOTS}
[arena]
rules = "still:Still"
population_limit = {ROBOTS}
birth_radius_m = 6.0
birth_interval_s = 5.0
cull_interval_s = 5.0
sample_interval_s = 5.0
end_s = {ROBOTS + LASTING_S}.0
"""


def lasting_s(place: Path, name: str, workers: int, threads: int) -> float:
    """Return the time that the robots take for the last simulated seconds [s]."""
    folder = place / name
    words = ("run", "still.toml", "--seed", "3", "--plugins", "still.py", "--quiet")
    flags = ("--workers", f"{workers}", "--threads", f"{threads}", "--out", name)
    command = [sys.executable, "-m", "revolve", *words, *flags]
    with subprocess.Popen(command, cwd=place) as run:
        grown = [(time.monotonic(), 0)]
        while run.poll() is None:
            time.sleep(0.01)
            if size(folder) != grown[-1][1]:
                grown.append((time.monotonic(), size(folder)))
    assert run.returncode == 0
    last = LASTING_S // 5
    assert len(advances(folder)) > ROBOTS
    return grown[-1][0] - grown[-1 - last][0]


def test_two_workers_are_nearly_twice_as_fast_as_one(tmp_path: Path) -> None:
    (tmp_path / "still.toml").write_text(DOCUMENT)
    (tmp_path / "still.py").write_text(RULES)
    ratios: list[float] = []
    for pair in range(PAIRS):
        one_s = lasting_s(tmp_path, f"one-{pair}", 1, 1)
        two_s = lasting_s(tmp_path, f"two-{pair}", 2, 1)
        threads_s = lasting_s(tmp_path, f"threads-{pair}", 1, 2)
        ratios.append(one_s / two_s)
        print(
            f"{ROBOTS} robots, {LASTING_S} s: one worker {one_s:.1f} s, two workers "
            f"{two_s:.1f} s ({ratios[-1]:.2f} times as fast), one of two threads "
            f"{threads_s:.1f} s ({one_s / threads_s:.2f} times)"
        )
        assert compare(tmp_path / f"one-{pair}", tmp_path / f"two-{pair}") == []
    assert mean(ratios) >= 1.85
