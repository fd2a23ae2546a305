"""Re-evaluation and culling are repeatable, whichever processes are killed."""

import signal
from collections.abc import Callable
from typing import Any

import numpy as np
import pyarrow.compute as pc
import pytest

from coordinator.storage.compare import compare
from schema.tables.files import read_table

pytestmark = [pytest.mark.system, pytest.mark.timeout(300)]

SHORT = """
name = "short-bridge"
births = 24
[simulation]
window_steps = 400
evaluation_s = [2.0, 4.0]
[selection]
population = 8
children = 1
[selection.reevaluation]
interval = 3
share = 0.4
[selection.culling]
population_limit = 12
population_floor = 6
"""
"""Judged over 2 s; a quarter of its evaluations are of who lives already."""


def test_killed_bridge_resumes_to_the_tables_of_one_process(
    stage: Any,  # noqa: ANN401 - the fixture
    until: Callable[[Callable[[], bool], str], None],
) -> None:
    (stage.folder / "short.toml").write_text(SHORT)
    words = ("short.toml", "--seed", "3", "--quiet", "--out")
    stage.run("run", *words, "calm", "--in-process")
    calm, killed = stage.folder / "calm", stage.folder / "killed"
    rows = read_table(calm, "evaluations")
    assert rows.filter(pc.greater(rows["trial"], 0)).num_rows >= 6
    lasted = np.array(rows["simulated_s"].drop_null())
    assert lasted.min() >= 2.0
    assert lasted.max() <= 4.0
    assert len(np.unique(lasted)) > 0.9 * len(lasted)

    share = np.random.default_rng(5).uniform(0.5, 0.9)
    journal, whole = killed / "journal.bin", (calm / "journal.bin").stat().st_size
    first = stage.start("run", *words, "killed", "--workers", "2")
    until(
        lambda: (
            (journal.exists() and journal.stat().st_size > share * whole)
            or first.poll() is not None
        ),
        "the run is on its way",
    )
    first.send_signal(signal.SIGKILL)
    first.wait()
    stage.run("resume", "killed", "--workers", "2", "--quiet")
    assert compare(calm, killed) == []
