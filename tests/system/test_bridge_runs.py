"""Repeatability of the bridge experiment: equal tables after a kill and a resume."""

import signal
from collections.abc import Callable
from typing import Any

import numpy as np
import pyarrow.compute as pc
import pytest

from coordinator.storage.compare import compare
from schema.tables.files import read_table
from tests.system.documents import BRIDGE

pytestmark = [pytest.mark.system, pytest.mark.timeout(300)]


def test_killed_bridge_resumes_to_the_tables_of_a_single_process(
    workspace: Any,  # noqa: ANN401 - the fixture
    until: Callable[[Callable[[], bool], str], None],
) -> None:
    (workspace.folder / "short.toml").write_text(BRIDGE)
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
