"""A run whose plug-in was changed after its start."""

import os
import signal

import pytest

from tests.system.fleet import agent_processes
from tests.system.workspace import PATIENCE_S, Workspace, wait_until

pytestmark = pytest.mark.system

DOCUMENT = """
name = "mine"
births = 8
[selection]
population = 6
[simulation]
warmup_steps = 5
window_steps = 40
[fitness]
function = "lab:far"
"""
MODULE = """
def far(track, fitness):
    return float(track.core_position[-1, 0])
"""
FAULTY = "\ndef far(track):\n    return 0.0\n"


def test_an_edited_module_does_not_stop_its_run(workspace: Workspace) -> None:
    """Neither restarted workers nor ``resume`` import it: they use the run's copy."""
    run, package = workspace.folder / "a", workspace.folder / "lab"
    package.mkdir()
    (package / "__init__.py").write_text("from lab.far import far\n")
    (package / "far.py").write_text(MODULE)
    slow = DOCUMENT.replace("births = 8", "births = 60").replace("= 40\n[", "= 800\n[")
    (workspace.folder / "mine.toml").write_text(slow)
    own = ("--workers", "1", "--quiet")
    started = workspace.start("run", "mine.toml", "--out", "a", *own)
    journal = run / "journal.bin"
    wait_until(lambda: journal.exists() and journal.stat().st_size > 3000, "births")
    (package / "far.py").write_text(FAULTY)
    workers = agent_processes(started.pid)
    assert len(workers) == 2, "a worker and an analyzer"
    for process in workers:
        os.kill(process, signal.SIGKILL)
    size = journal.stat().st_size
    wait_until(lambda: journal.stat().st_size > size + 2000, "births of new workers")
    started.send_signal(signal.SIGINT)
    _, told = started.communicate(timeout=PATIENCE_S)
    assert "differs" not in told
    assert (run / "state").read_text().strip() == "stopped"

    assert "far.py:2: in order" in workspace.run("check", "a")
    workspace.run("resume", "a", *own)
    assert (run / "state").read_text().strip() == "finished"
    workspace.run("robot", "simulate", "a/best.yaml")
    told = workspace.run("check", "mine.toml", code=1)
    assert "far.py:2: 'lab:far' must take 2 arguments" in told
