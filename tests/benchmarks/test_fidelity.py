"""Arithmetic of the fidelity benchmark."""

import re
from pathlib import Path

import numpy as np
import pytest

from schema.errors import ExperimentError
from schema.experiment.document import Experiment, Islands, Simulation
from schema.robot.brain import Brain
from schema.robot.robot import Robot
from tests.benchmarks.fidelity import main, read_population, sample_thirds
from tests.benchmarks.run_folder import write_run
from tests.worker.conftest import random_robot


def test_each_third_is_sampled_equally() -> None:
    fitness = np.random.default_rng(4).permutation(30).astype(float)
    chosen = fitness[sample_thirds(fitness, 4, 1)]
    assert (chosen[:4] < 10).all()
    assert ((chosen[4:8] >= 10) & (chosen[4:8] < 20)).all()
    assert (chosen[8:] >= 20).all()
    assert len(set(chosen.tolist())) == 12
    with pytest.raises(ExperimentError, match="3 x 11 robots are needed"):
        sample_thirds(fitness, 11, 1)


def test_robots_have_the_settings_of_their_islands(tmp_path: Path) -> None:
    """A robot of island 0 moves to island 1; one evaluation has its own length."""
    clocks = [Simulation(window_steps=steps) for steps in (200, 400)]
    islands = tuple(Islands(simulation=clock) for clock in clocks)
    experiment = Experiment(name="test", islands=islands)
    turtle = random_robot(1)
    other = Robot(turtle.parts[:1], Brain(turtle.brain.neurons[:6]))
    write_run(
        tmp_path,
        experiment,
        births=[(0, 7, turtle), (1, 7, other)],
        evaluations=[
            (0, 7, None, 1.0, 0.2),
            (1, 7, 0, 2.0, 0.3),
            (1, 7, None, 2.5, 0.1),
        ],
    )
    population = read_population(tmp_path)
    assert population.fitness.tolist() == [0.2, 0.3, 0.1]
    assert [each.robot for each in population.robots] == [turtle, turtle, other]
    clocks = [each.experiment.simulation for each in population.robots]
    assert [clock.window_steps for clock in clocks] == [200, 400, 400]
    assert [clock.warmup_steps for clock in clocks] == [0, 0, 100]


def test_random_robots_agree_with_finer_steps(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A small version of the benchmark."""
    experiment = Experiment(name="test", simulation=Simulation(window_steps=1200))
    numbers = range(12)
    write_run(
        tmp_path,
        experiment,
        births=[(0, number, random_robot(number)) for number in numbers],
        evaluations=[(0, number, None, 6.0, 0.1 * number) for number in numbers],
    )
    main(tmp_path, 4, 1, [])
    first, _, *best = capsys.readouterr().out.splitlines()
    correlation = re.search(r"12 robots .*: Spearman ([\d.]+)", first)
    assert correlation is not None
    assert float(correlation[1]) > 0.8
    assert len(best) == 10
