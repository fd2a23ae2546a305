"""Commands ``revolve bench evaluate`` and ``revolve bench fidelity``."""

from collections.abc import Callable
from pathlib import Path

import pytest

from analyzer.report import analyze
from coordinator.evolution.generation import generate
from schema.errors import ExperimentError, SimulationDiverged
from schema.experiment.document import Experiment, Simulation
from schema.robot.robot import Robot
from tests.worker.bench.run_folder import write_run
from worker.bench.arena_bench import RobotSource
from worker.bench.command import main

SHORT = Experiment(
    name="test", simulation=Simulation(window_steps=1000, evaluation_s=(5.0, 6.0))
)
ROBOTS = RobotSource(generate, analyze)


@pytest.fixture
def run(tmp_path: Path, robot_of: Callable[[int], Robot]) -> Path:
    """Return the folder of a run of three robots."""
    numbers = range(3)
    write_run(
        tmp_path,
        SHORT,
        births=[(0, number, robot_of(number)) for number in numbers],
        evaluations=[(0, number, None, 5.5, 0.1 * number) for number in numbers],
    )
    return tmp_path


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        (
            ["pose_steps=48", "brain_steps=33"],
            "simulation.window_steps: must be a multiple of .* = 48, got 1000",
        ),
        (["armatur=0.1"], "simulation.armatur: no such key"),
    ],
)
def test_changes_are_checked_together_with_the_run(
    run: Path, changes: list[str], problem: str
) -> None:
    flags = [word for change in changes for word in ("--against", change)]
    arguments = ["bench", "fidelity", str(run), "--per-third", "1", *flags]
    with pytest.raises(ExperimentError, match=f"^--against: {problem}"):
        main(arguments, ROBOTS)


def test_changes_that_fit_the_run_only_are_possible(
    run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """125 divides the run's window of 1000 steps, not the default one of 2400."""
    arguments = ["fidelity", str(run), "--per-third", "1", "--against"]
    main(["bench", *arguments, "pose_steps=125"], ROBOTS)
    first, thirds, *winners = capsys.readouterr().out.splitlines()
    assert first.startswith(f"3 robots of {run}: Spearman ")
    assert thirds == "  by thirds, least fit first: undefined, undefined, undefined"
    assert len(winners) == 3


def test_robots_that_all_diverge_cannot_be_timed(tmp_path: Path) -> None:
    path = tmp_path / "tiny.toml"
    path.write_text('name = "tiny"\n[simulation]\nmass_factor = 1e-9\n')
    message = "all 2 random robots diverged: there is nothing to time"
    with pytest.raises(SimulationDiverged, match=message):
        main(["bench", "evaluate", str(path), "--robots", "2"], ROBOTS)
