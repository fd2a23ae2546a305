"""Coupled oscillators: frequency, phase locking, independence of the batch."""

from math import asin, pi, sin

import numpy as np
import pytest

from schema.errors import ExperimentError
from schema.experiment.document import BrainSection, Space
from schema.robot.brain import INPUT, Brain, Connection, Neuron
from schema.robot.cpg import PHASE_OSCILLATOR
from worker.robot.brains import Controls, solo_brain
from worker.robot.check_controls import check_controls

TICK_S = 0.125


def controls_of(**parameters: float) -> Controls:
    return Controls(BrainSection(type="cpg", parameters=parameters), Space(), TICK_S)


def oscillator(hz: float, phase: float, amplitude: float, centre: float) -> Neuron:
    return Neuron("output", PHASE_OSCILLATOR, 0, (hz, phase, amplitude, centre))


def pair(first: Neuron, second: Neuron, weight: float) -> Brain:
    edges = (Connection(0, 1, weight), Connection(1, 0, weight))
    return Brain((first, second), edges)


def test_free_oscillator_has_its_frequency_offset_amplitude_and_centre() -> None:
    brain = Brain((Neuron("input", INPUT, 0), oscillator(0.7, 0.2, 0.6, 0.4)))
    solo = solo_brain(controls_of(), brain, 100)
    nines = np.full((1, 10), 9.0)
    found = [float(solo.step(nines, float(tick))[0, 0]) for tick in range(100)]
    expected = [
        0.4 + 0.3 * sin(2.0 * pi * (0.7 * TICK_S * tick + 0.2)) for tick in range(100)
    ]
    assert found == pytest.approx(expected, abs=1e-9)


def test_two_coupled_oscillators_lock_to_the_commanded_difference() -> None:
    """From a quarter of a period away, the deviation decays as tan(d/2) exp(-2 w t)."""
    brain = pair(oscillator(1.0, 0.1, 1.0, 0.5), oscillator(1.0, 0.45, 1.0, 0.5), 0.5)
    bank = controls_of(coupling=1.0).bank([controls_of(coupling=1.0).pack(brain)])
    bank.states[0, :2] = 0.0, 0.5 * pi
    for tick in range(1, 9):
        outputs = bank.step(np.zeros((1, 10)), float(tick))[0]
        deviation = bank.states[0, 1] - bank.states[0, 0]
        expected = 2.0 * np.arctan(
            np.tan(0.25 * pi) * np.exp(-2.0 * 0.5 * tick * TICK_S)
        )
        assert deviation == pytest.approx(expected, abs=1e-5)
    for tick in range(9, 400):
        outputs = bank.step(np.zeros((1, 10)), float(tick))[0]
    mean = bank.states[0, :2].mean()
    assert bank.states[0, 1] - bank.states[0, 0] == pytest.approx(0.0, abs=1e-9)
    assert outputs[0] == pytest.approx(0.5 + 0.5 * sin(mean + 0.2 * pi))
    assert outputs[1] == pytest.approx(0.5 + 0.5 * sin(mean + 0.9 * pi))


def test_oscillators_of_other_frequencies_lock_with_a_lag() -> None:
    """Of two: sin(lag) = (difference of frequencies) / (2 coupling)."""
    brain = pair(oscillator(1.0, 0.0, 1.0, 0.5), oscillator(1.2, 0.0, 1.0, 0.5), 0.5)
    controls = controls_of(coupling=4.0)
    bank = controls.bank([controls.pack(brain)])
    for tick in range(400):
        before = bank.states.copy()
        bank.step(np.zeros((1, 10)), float(tick))
    lag = bank.states[0, 1] - bank.states[0, 0]
    assert lag == pytest.approx(asin(2.0 * pi * 0.2 / (2.0 * 2.0)), abs=1e-6)
    speed = (bank.states - before)[0, :2] / TICK_S
    assert speed == pytest.approx(2.0 * pi * 1.1, abs=1e-6)


def test_a_coupling_acts_on_its_target_only() -> None:
    brain = Brain(
        (oscillator(1.0, 0.0, 1.0, 0.5), oscillator(1.0, 0.0, 1.0, 0.5)),
        (Connection(0, 1, 1.0),),
    )
    controls = controls_of()
    bank = controls.bank([controls.pack(brain)])
    bank.states[0, 1] = 1.0
    for tick in range(1, 100):
        bank.step(np.zeros((1, 10)), float(tick))
    assert bank.states[0, :2] == pytest.approx(2.0 * pi * 99 * TICK_S)


def test_brains_are_independent_of_the_batch_and_can_be_restored() -> None:
    check_controls(controls_of())
    check_controls(controls_of(coupling=100.0))


def test_numbers_of_files_beyond_all_ranges_stay_finite() -> None:
    huge = Neuron("output", PHASE_OSCILLATOR, 0, (1e308, -1e308, 1e308, 1e308))
    solo = solo_brain(controls_of(), pair(huge, huge, -1e308), 50)
    zeros = np.zeros((1, 10))
    assert all(np.isfinite(solo.step(zeros, float(t))).all() for t in range(50))


def test_an_empty_range_of_frequencies_is_refused() -> None:
    with pytest.raises(ExperimentError, match=r"brain\.parameters: lowest_hz must be"):
        controls_of(lowest_hz=3.0)
    with pytest.raises(ExperimentError, match=r"brain\.parameters\.coupling"):
        controls_of(coupling=-1.0)
