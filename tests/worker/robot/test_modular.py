"""Modules with shared weights: two ticks by hand, independence of the batch."""

import numpy as np
import pytest

from schema.experiment.document import BrainSection, Space
from schema.robot.brain import INPUT, Brain, Connection, Neuron
from worker.robot.brains import Controls, solo_brain
from worker.robot.check_controls import check_controls

CONTROLS = Controls(BrainSection(type="modular"), Space(max_hidden=60), 0.125)


def test_two_ticks_of_two_modules_by_hand() -> None:
    """A core with one sensor and a hinge, each of two neurons; weights are as given.

    x = tanh(b + V s / 10 + W x + P x_parent + C x_child); the states are -1 at birth.
    """
    bias, sensing = np.array([0.2, -0.4]), np.array([1.5, -0.5])
    own = np.array([[0.5, -1.0], [1.25, 0.75]])
    of_parent = np.array([[-0.3, 0.6], [0.9, 0.1]])
    of_child = np.array([[1.1, -0.7], [0.4, -1.9]])
    neurons = (
        Neuron("input", INPUT, 0),
        Neuron("output", "ModuleNeuron", 1, (bias[0],)),
        Neuron("hidden", "ModuleNeuron", 0, (bias[0],)),
        Neuron("hidden", "ModuleNeuron", 0, (bias[1],)),
        Neuron("hidden", "ModuleNeuron", 1, (bias[1],)),
    )
    core, hinge = (2, 3), (1, 4)
    edges = [Connection(0, core[at], sensing[at]) for at in (0, 1)]
    for weights, sources, targets in (
        (own, core, core), (own, hinge, hinge),
        (of_parent, core, hinge), (of_child, hinge, core),
    ):  # fmt: skip
        edges += [
            Connection(sources[j], targets[i], weights[i, j])
            for i in (0, 1)
            for j in (0, 1)
        ]
    brain = Brain(neurons, tuple(edges))
    x_core, x_hinge = -np.ones(2), -np.ones(2)
    bank = CONTROLS.bank([CONTROLS.pack(brain)])
    solo = solo_brain(CONTROLS, brain, 2)
    for tick, reading in enumerate((3.0, -8.0)):
        x_core, x_hinge = (
            np.tanh(bias + sensing * reading / 10 + own @ x_core + of_child @ x_hinge),
            np.tanh(bias + own @ x_hinge + of_parent @ x_core),
        )
        readings = np.zeros((1, 10))
        readings[0, 0] = reading
        for each in (bank, solo):
            outputs = each.step(readings, float(tick))
            assert outputs[0, 0] == pytest.approx(0.5 + 0.5 * x_hinge[0], abs=1e-12)
            hidden = each.states[0, 10:13]
            wanted = 0.5 + 0.5 * np.array([*x_core, x_hinge[1]])
            assert hidden == pytest.approx(wanted, abs=1e-12)
        assert not np.allclose(x_core, x_hinge)


def test_brains_are_independent_of_the_batch_and_can_be_restored() -> None:
    check_controls(CONTROLS)


def test_numbers_of_files_beyond_all_ranges_stay_finite() -> None:
    huge = Neuron("output", "ModuleNeuron", 0, (1e308,))
    edges = (Connection(0, 1, 1e308), Connection(1, 0, -1e308))
    solo = solo_brain(CONTROLS, Brain((huge, huge), edges), 9)
    zeros = np.zeros((1, 10))
    assert all(np.isfinite(solo.step(zeros, float(t))).all() for t in range(9))
