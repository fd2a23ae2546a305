"""Cull of 70 % in an arena of 30 mature robots, none of them below the share."""

from collections import Counter
from pathlib import Path
from typing import Any

import pytest

from schema.tables.files import read_table

pytestmark = [pytest.mark.system, pytest.mark.timeout(300)]

# No robot is below 0 times the mean fitness, so the arena fills up to its limit.
FULL_ARENA = """
name = "full"
births = 34
[selection]
population = 29
[simulation]
pose_steps = 25
warmup_steps = 100
window_steps = 200
[arena]
founder_interval_s = 0.125
birth_interval_s = 0.5
cull_interval_s = 2.5
sample_interval_s = 0.5
snapshot_interval_s = 100.0
survive_share_of_mean = 0.0
"""


def test_a_full_arena_loses_the_least_fit_seven_tenths(
    workspace: Any,  # noqa: ANN401 - a fixture's class
) -> None:
    folder: Path = workspace.folder
    (folder / "full.toml").write_text(FULL_ARENA)
    flags = ("--seed", "2", "--quiet", "--in-process", "--threads", "1")
    workspace.run("run", "full.toml", *flags, "--out", "run")
    deaths = read_table(folder / "run", "deaths").to_pylist()
    assert Counter(row["reason"] for row in deaths) == {"cull": 21}
    (time_s,) = {row["sim_time_s"] for row in deaths}
    population = read_table(folder / "run", "population").to_pylist()
    before = [row for row in population if row["births"] == 30]
    assert len(before) == 30
    # Births go on below the limit: 30 - 21 + 4.
    assert sum(row["births"] == 34 for row in population) == 13
    samples = read_table(folder / "run", "fitness").to_pylist()
    last = max(row["sim_time_s"] for row in samples if row["sim_time_s"] <= time_s)
    fitness = {
        row["birth"]: row["fitness"] for row in samples if row["sim_time_s"] == last
    }
    assert len(fitness) == 30
    dead = {row["birth"] for row in deaths}
    weakest = max(value for birth, value in fitness.items() if birth in dead)
    fittest = min(value for birth, value in fitness.items() if birth not in dead)
    assert weakest < fittest
