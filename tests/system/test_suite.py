"""A suite that is killed and resumed, against evaluations of its robots here."""

import os
import signal
from pathlib import Path

import msgspec
import numpy as np
import pytest

import revolve as rv
from revolve.suite.score import Score
from tests.system.tiny_suite import STEPS, tiny
from tests.system.workspace import Workspace, wait_until

pytestmark = pytest.mark.system

MINE = f"""
name = "mine"
[selection]
population = 4
children = 2
tournament_size = 2
[simulation]
window_steps = {STEPS}
[learning]
budget = 3
"""
MODULE = ("-m", "tests.system.tiny_suite", "mine.toml")


def test_killed_suite_is_resumed_to_the_same_bytes(workspace: Workspace) -> None:
    folder = workspace.folder
    (folder / "mine.toml").write_text(MINE)
    killed = workspace.start(*MODULE[2:], "killed", module=MODULE[1])
    begun = folder / "killed" / "turning-1" / "run.json"
    wait_until(begun.exists, "the last run begins", 60)
    os.killpg(killed.pid, signal.SIGKILL)
    killed.communicate()
    assert not (folder / "killed" / "score.json").exists()
    workspace.python(*MODULE, "killed")
    workspace.python(*MODULE, "calm")
    text = (folder / "calm" / "score.json").read_bytes()
    assert (folder / "killed" / "score.json").read_bytes() == text
    workspace.python(*MODULE, "calm")
    assert (folder / "calm" / "score.json").read_bytes() == text
    check_score(msgspec.json.decode(text, type=Score), folder / "calm")
    (folder / "mine.toml").write_text(MINE.replace("children = 2", "children = 4"))
    told = workspace.python(*MODULE, "calm", code=1)
    assert "calm: holds runs of another experiment or version; choose" in told


def check_score(score: Score, folder: Path) -> None:
    """Compare a score with the tables of its runs, and with evaluations."""
    assert score.name == "mine"
    assert score.experiment["learning"]["budget"] == 3
    assert "fitness" not in score.experiment
    for task, own in score.tasks.items():
        assert own.evaluations == [3 * tiny().births] * 2
        for repeat in range(2):
            run = rv.Run(folder / f"{task}-{repeat}")
            greatest = max(run.evaluations["fitness"].to_pylist())
            assert own.first[repeat] == greatest
            (robot,) = run.best_ever()
            simulation = {"warmup_steps": STEPS, "window_steps": 4 * STEPS}
            trace = rv.simulate(robot, run.experiment.replace(simulation=simulation))
            if task == "locomotion":
                assert own.later[repeat] == pytest.approx(mean_of(trace), rel=1e-6)


def mean_of(trace: rv.Trace) -> float:
    """Return the mean over four windows of the thesis's fitness, from the places."""
    places = trace.core_position[:, :2]
    count = (len(places) - 1) // 4
    fitness = []
    for start in range(0, 4 * count, count):
        own = places[start : start + count + 1]
        path = np.hypot(*np.diff(own, axis=0).T).sum()
        straight = np.hypot(*(own[-1] - own[0]))
        fitness.append((path + 5 * straight) / (STEPS * 0.005))
    return float(np.mean(fitness))
