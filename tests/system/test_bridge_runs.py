"""Repeatability of the bridge experiment: equal tables after a kill and a resume."""

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
"""Evaluations of 2 s to 4 s; a quarter of them are re-evaluations."""


def test_killed_bridge_resumes_to_the_tables_of_a_single_process(
    workspace: Any,  # noqa: ANN401 - the fixture
    until: Callable[[Callable[[], bool], str], None],
) -> None:
    (workspace.folder / "short.toml").write_text(SHORT)
    words = ("short.toml", "--seed", "3", "--quiet", "--out")
    workspace.run("run", *words, "calm", "--in-process")
    reference, killed = workspace.folder / "calm", workspace.folder / "killed"
    rows = read_table(reference, "evaluations")
    assert rows.filter(pc.greater(rows["trial"], 0)).num_rows >= 6
    durations_s = np.array(rows["simulated_s"].drop_null())
    assert durations_s.min() >= 2.0
    assert durations_s.max() <= 4.0
    assert len(np.unique(durations_s)) > 0.9 * len(durations_s)

    share = np.random.default_rng(5).uniform(0.5, 0.9)
    journal, whole = killed / "journal.bin", (reference / "journal.bin").stat().st_size
    first = workspace.start("run", *words, "killed", "--workers", "2")
    until(
        lambda: (
            (journal.exists() and journal.stat().st_size > share * whole)
            or first.poll() is not None
        ),
        "the run is on its way",
    )
    first.send_signal(signal.SIGKILL)
    first.wait()
    workspace.run("resume", "killed", "--workers", "2", "--quiet")
    assert compare(reference, killed) == []
