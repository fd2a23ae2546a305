"""Plug-ins of users that are changed after the start, or packed with a robot."""

import os
import shutil
import signal
from pathlib import Path

import pytest

from tests.system.fleet import agent_processes
from tests.system.workspace import PATIENCE_S, Workspace, wait_until

pytestmark = pytest.mark.system

CRAWLERS = Path(__file__).parents[1] / "plugins" / "crawlers.py"
SPACE = """
[space]
part_types = [
    "schema.parts:CORE", "schema.parts:FIXED_BRICK", "crawlers:PISTON",
    "schema.robogen_parts:ACTIVE_WHEEL", "schema.robogen_parts:WHEEL",
    "schema.robogen_parts:IR_SENSOR",
]
max_inputs = 16
"""
EVALUATE = """
import revolve as rv
try:
    rv.Robot.read("best.robot")
except rv.ExperimentError as error:
    print(error)
rv.allow("best.robot")
robot = rv.Robot.read("best.robot")
print(robot.experiment.name, robot.origin.fitness, rv.evaluate(robot).fitness)
robot.write("again.robot")
with rv.Fleet(workers=1) as fleet:
    print(next(fleet.evaluate([robot], robot.experiment)).fitness)
"""
REFUSED = (
    "plug-in crawlers: is not allowed, but best.robot was made with {}; an import runs "
    "its code: if you trust it, add --plugins best.robot (in Python: revolve.allow, in "
    "a new process)"
)


def moved(workspace: Workspace, monkeypatch: pytest.MonkeyPatch) -> Workspace:
    """Return an empty folder, on a machine where no run was, with the packed robot."""
    away = Workspace(workspace.folder / "away")
    away.folder.mkdir()
    monkeypatch.setenv("XDG_STATE_HOME", str(away.folder / "state"))
    shutil.move(workspace.folder / "best.robot", away.folder)
    shutil.rmtree(workspace.folder / "run")
    (workspace.folder / "crawlers.py").unlink()
    return away


def test_a_packed_robot_needs_no_run(
    workspace: Workspace, monkeypatch: pytest.MonkeyPatch
) -> None:
    shutil.copy(CRAWLERS, workspace.folder)
    text = f'name = "crawlers"\n{SPACE}'
    (workspace.folder / "mine.toml").write_text(text)
    words = ("mine.toml", "--births", "30", "--seed", "3", "--quiet", "--in-process")
    workspace.run("run", *words, "--out", "run")
    beside = workspace.run("robot", "simulate", "run/best.yaml")
    for name in ("best", "same"):
        workspace.run("robot", "pack", "run", f"{name}.robot")
    first, second = (workspace.folder / f"{name}.robot" for name in ("best", "same"))
    assert first.read_bytes() == second.read_bytes()
    away = moved(workspace, monkeypatch)
    packed = ("best.robot", "--plugins", "best.robot")
    told = away.run("robot", "simulate", *packed)
    numbers = [line for line in beside.splitlines() if line[:8] != "revolve:"]
    assert told.splitlines()[: len(numbers)] == numbers

    shown = away.run("robot", "show", *packed).splitlines()
    assert shown[0].startswith("birth 0:")
    digest = shown[1].removeprefix("plug-in crawlers, source digest ")
    refused = away.run("robot", "show", "best.robot", code=2).splitlines()
    assert refused == [*shown[:2], f"revolve: {REFUSED.format(digest)}"]
    assert "viable" in away.run("robot", "check", *packed)
    away.run("robot", "convert", "best.robot", "best.xml", *packed[1:])
    away.run("robot", "render", "best.robot", "best.png", *packed[1:])

    (fitness,) = (line.split()[1] for line in numbers if line[:8] == "fitness:")
    lines = away.python("-W", "error", "-c", EVALUATE).splitlines()
    assert lines == [
        REFUSED.format(digest), f"crawlers {fitness} {fitness}", fitness
    ]  # fmt: skip
    again = away.folder / "again.robot"
    assert again.read_bytes() == (away.folder / "best.robot").read_bytes()


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
