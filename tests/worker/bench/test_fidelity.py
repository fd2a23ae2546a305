"""Arithmetic of the fidelity benchmark."""

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from msgspec.structs import replace
from scipy.stats import spearmanr

from schema.errors import ExperimentError, RunFolderError
from schema.experiment.document import Experiment, Fitness, Islands, Simulation
from schema.plugins.permission import allow
from schema.robot.brain import Brain
from schema.robot.robot import Robot
from tests.worker.bench.run_folder import write_run
from worker.bench.fidelity import (
    Evaluated,
    compare,
    read_population,
    sample_thirds,
    spearman,
    winners,
)
from worker.robot.robustness import finer


def test_spearman_equals_that_of_scipy_with_ties() -> None:
    rng = np.random.default_rng(3)
    for _ in range(20):
        first = rng.integers(0, 6, 25).astype(float)
        second = first + rng.integers(-2, 3, 25).astype(float)
        assert spearman(first, second) == pytest.approx(
            spearmanr(first, second).statistic, abs=1e-12
        )


def test_each_third_is_sampled_equally() -> None:
    fitness = np.random.default_rng(4).permutation(30).astype(float)
    chosen = fitness[sample_thirds(fitness, 4, 1)]
    assert (chosen[:4] < 10).all()
    assert ((chosen[4:8] >= 10) & (chosen[4:8] < 20)).all()
    assert (chosen[8:] >= 20).all()
    assert len(set(chosen.tolist())) == 12
    with pytest.raises(ExperimentError, match="3 x 11 robots are needed"):
        sample_thirds(fitness, 11, 1)


def test_winners_are_the_ten_fittest_in_order() -> None:
    fitness = np.arange(20.0)
    assert winners(fitness) == list(range(19, 9, -1))


def test_finer_simulation_has_the_same_duration() -> None:
    world = finer(Simulation(warmup_steps=600))
    assert world.timestep_s == pytest.approx(0.001)
    assert (world.brain_steps, world.pose_steps) == (125, 200)
    assert (world.window_steps, world.warmup_steps) == (12_000, 3000)


def test_folder_without_a_run_is_rejected(tmp_path: Path) -> None:
    with pytest.raises(RunFolderError, match="no run is there"):
        read_population(tmp_path)


def test_robots_have_the_settings_of_their_islands(
    turtle: Robot, tmp_path: Path
) -> None:
    """A robot of island 0 moves to island 1; one evaluation has its own length."""
    clocks = [Simulation(window_steps=steps) for steps in (200, 400)]
    islands = tuple(Islands(simulation=clock) for clock in clocks)
    experiment = Experiment(name="test", islands=islands)
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


def test_same_simulation_agrees_and_a_diverging_one_counts_zero(turtle: Robot) -> None:
    short = Simulation(window_steps=400)
    one = Evaluated(turtle, Experiment(name="test", simulation=short))
    same = compare([one], lambda experiment: experiment.simulation)
    assert same[0].tolist() == same[1].tolist() != [0.0]
    wild = replace(short, timestep_s=0.5, servo_armature=0.0, servo_stiffness=1e9)
    assert compare([one], lambda _experiment: wild)[1].tolist() == [0.0]


def test_undefined_fitness_counts_zero(turtle: Robot, tmp_path: Path) -> None:
    (tmp_path / "undefined.py").write_text("def value(trace, fitness):\n    1 / 0\n")
    allow([str(tmp_path / "undefined.py")])
    experiment = Experiment(
        name="test",
        simulation=Simulation(window_steps=80),
        fitness=Fitness(function="undefined:value"),
    )
    one = Evaluated(turtle, experiment)
    assert compare([one], lambda each: finer(each.simulation)).tolist() == [[0], [0]]


def test_correlation_of_equal_numbers_is_undefined() -> None:
    for first in ([0.5], [0.0, 0.0]):
        assert math.isnan(spearman(np.array(first), np.arange(1.0 * len(first))))


def test_random_robots_agree_with_finer_steps(robot_of: Callable[[int], Robot]) -> None:
    """A small version of ``revolve bench fidelity``."""
    experiment = Experiment(name="test", simulation=Simulation(window_steps=1200))
    robots = [Evaluated(robot_of(seed), experiment) for seed in range(12)]
    found = compare(robots, lambda each: finer(each.simulation))
    assert found.shape == (2, 12)
    assert spearman(*found) > 0.8
