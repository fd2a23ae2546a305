"""The sliding window, with results computed by hand."""

import numpy as np
import pytest
from msgspec.structs import replace

from schema.experiment.document import Simulation
from schema.robot.trace import Trace
from tests.worker.arena_cases import SETTINGS
from worker.clusters.robot import FitnessWindow
from worker.fitness import load_fitness, path_velocity, straight_velocity

CLOCK = Simulation(
    timestep_s=0.01, pose_steps=10, brain_steps=10, window_steps=80, warmup_steps=20
)
"""Samples every 0.1 s, a window of 0.8 s, a warm-up of 0.2 s."""


def track(window: FitnessWindow) -> Trace:
    return Trace(0.1, np.array(window.positions))


def test_window_excludes_fall_and_warm_up() -> None:
    window = FitnessWindow(CLOCK, born=100)
    window.add(110, (9.0, 9.0, 9.0))
    assert not window.positions
    window.add(120, (0.0, 0.0, 0.0))
    window.add(130, (0.1, 0.0, 0.0))
    has_fitness = [window.has_fitness]
    window.add(140, (0.1, 0.1, 5.0))
    has_fitness.append(window.has_fitness)
    assert has_fitness == [False, True]
    assert path_velocity(track(window)) == pytest.approx(1.0)
    assert straight_velocity(track(window)) == pytest.approx(2**0.5 / 2)


def test_window_is_mature_after_warm_up_and_window() -> None:
    """200 + 800 ms: from the sample at age 1 s on."""
    window = FitnessWindow(CLOCK, born=50)
    mature = []
    for step in range(50, 200, 10):
        window.add(step, (0.0, 0.0, 0.0))
        mature.append(window.is_mature)
    assert mature.index(True) == (20 + 80) // 10


def test_window_drops_old_samples() -> None:
    """East at 1 m/s for 0.8 s, then back west: after 0.4 s of that s is 0."""
    window = FitnessWindow(CLOCK, born=0)
    places = [0.1 * min(n, 16 - n) for n in range(17)]
    straight, path = [], []
    for number, x in enumerate(places):
        window.add(20 + 10 * number, (x, 0.0, 0.0))
        if window.is_mature:
            straight.append(straight_velocity(track(window)))
            path.append(path_velocity(track(window)))
    assert straight == pytest.approx([1.0, 0.75, 0.5, 0.25, 0.0, 0.25, 0.5, 0.75, 1.0])
    assert path == pytest.approx([1.0] * 9)
    assert len(window.positions) == 9


def test_fitness_of_the_window_uses_the_experiment_s_weights() -> None:
    window = FitnessWindow(CLOCK, born=0)
    for number in range(9):
        window.add(20 + 10 * number, (0.01 * number, 0.0, 0.0))
    fitness = replace(SETTINGS.fitness, path_weight=1.0, straight_weight=5.0)
    assert load_fitness(fitness).value(track(window)) == pytest.approx(0.6)
