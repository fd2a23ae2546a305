"""Brains: formulas, independence of the robots of a batch, and robots alone."""

import math
from collections.abc import Callable
from typing import cast

import numpy as np
import pytest

from schema.errors import InvalidRobot
from schema.experiment.brains import widths
from schema.experiment.document import Space
from schema.robot.brain import INPUT, Brain, Connection, Neuron, check_widths
from schema.robot.robot import Robot
from schema.robot.trace import Floats
from worker.robot.banks import GuardedBank, NetworkBank, PackedNetwork, broken_rows
from worker.robot.brains import SoloNetwork, pack
from worker.robot.own_neurons import STATE_LIMIT

WIDTH = widths(Space())
TICK_S = 0.125


def outputs_of(brain: Brain, readings: list[float], ticks: int) -> list[float]:
    """Return the first output after each of some ticks of constant readings."""
    bank = NetworkBank([pack(brain, WIDTH)], WIDTH, TICK_S)
    row = np.zeros((1, WIDTH.inputs))
    row[0, : len(readings)] = readings
    return [float(bank.step(row, float(tick))[0, 0]) for tick in range(ticks)]


@pytest.mark.parametrize(
    ("kind", "expected"),
    [("Simple", 0.625), ("Sigmoid", 1.0 / (1.0 + math.exp(-0.625)))],
)
def test_neurons_of_the_input_above_their_bias(kind: str, expected: float) -> None:
    """0.5 (0.75 * 2 - 0.25) = 0.625."""
    neurons = Neuron("input", INPUT, 0), Neuron("output", kind, 1, (0.25, 0.5))
    brain = Brain(neurons, (Connection(0, 1, 0.75),))
    assert outputs_of(brain, [2.0], 1) == pytest.approx([expected], abs=1e-15)


def test_oscillator_has_phase_in_periods_and_ignores_inputs() -> None:
    brain = Brain(
        (Neuron("input", INPUT, 0), Neuron("output", "Oscillator", 1, (2.0, 0.3, 1.6))),
        (Connection(0, 1, 0.75), Connection(1, 1, 1.0)),
    )
    expected = [
        0.5 - 0.8 + 1.6 * (math.sin(2 * math.pi / 2.0 * (t - 2.0 * 0.3)) + 1) / 2
        for t in (0.0, 0.125, 0.25, 0.375)
    ]
    assert outputs_of(brain, [9.0], 4) == pytest.approx(expected, abs=1e-14)


def test_all_neurons_are_updated_from_the_previous_states() -> None:
    """A signal takes one tick per connection: input, hidden, output."""
    brain = Brain(
        (
            Neuron("input", INPUT, 0),
            Neuron("output", "Simple", 1, (0.0, 1.0)),
            Neuron("hidden", "Simple", 1, (0.0, 1.0)),
        ),
        (Connection(0, 2, 1.0), Connection(2, 1, 1.0)),
    )
    assert outputs_of(brain, [3.0], 3) == [0.0, 3.0, 3.0]


@pytest.mark.parametrize("period", [0.0, 1e-300, 1e-9, -1.0])
def test_tiny_period_gives_finite_outputs(period: float) -> None:
    brain = Brain((Neuron("output", "Oscillator", 0, (period, 1.0, 2.0)),))
    found = outputs_of(brain, [], 50)
    assert all(-0.5 <= value <= 1.5 for value in found)


def test_more_neurons_than_the_limit_are_rejected() -> None:
    brain = Brain(tuple(Neuron("hidden", "Simple", 0, (0.0, 1.0)) for _ in range(11)))
    with pytest.raises(InvalidRobot, match=r"must be <= space.max_hidden = 10, got 11"):
        check_widths(brain, WIDTH)


@pytest.fixture(scope="module")
def networks(robot_of: Callable[[int], Robot]) -> list[PackedNetwork]:
    return [pack(robot_of(seed).brain, WIDTH) for seed in range(100)]


@pytest.mark.parametrize("count", [1, 2, 7, 30, 100])
def test_outputs_are_independent_of_the_batch(
    networks: list[PackedNetwork], count: int
) -> None:
    """Outputs are equal to the last bit: alone, and in any row of any batch."""
    rng = np.random.default_rng(count)
    ticks = 96
    readings = rng.normal(0.0, 5.0, (ticks, 100, WIDTH.inputs))
    ages = rng.integers(0, 100_000, (100, 1)).astype(float)
    chosen = rng.permutation(100)[:count]
    batch = NetworkBank([networks[i] for i in chosen], WIDTH, TICK_S)
    alone = [NetworkBank([networks[i]], WIDTH, TICK_S) for i in chosen]
    for tick in range(ticks):
        together = batch.step(readings[tick, chosen], ages[chosen] + tick)
        for row, i in enumerate(chosen):
            single = alone[row].step(
                readings[tick, i : i + 1], float(ages[i, 0] + tick)
            )
            assert single.tobytes() == together[row].tobytes()
            assert alone[row].states.tobytes() == batch.states[row].tobytes()


def test_complex_outputs_of_a_brain_type_are_a_failed_result() -> None:
    class Complex:
        states = np.zeros((1, 0))

        def step(self, readings: Floats, age_ticks: Floats | float) -> Floats:
            del readings
            outputs = np.full((1, WIDTH.outputs), 0.5)
            return cast("Floats", outputs + 1j) if age_ticks else outputs

    bank = GuardedBank(lambda _: Complex(), [()], WIDTH.outputs)
    readings = np.zeros((1, WIDTH.inputs))
    assert not broken_rows(bank, bank.step(readings, 0.0))
    outputs = bank.step(readings, 1.0)
    assert "complex128" in broken_rows(bank, outputs)[0]


# --- a robot alone, against a bank of one -------------------------------------

SQUEEZED = Neuron("hidden", "Sigmoid", 0, (0.3, 0.7))
LINEAR = Neuron("output", "Simple", 0, (-0.2, 0.9))
SWINGING = Neuron("output", "Oscillator", 0, (1.7, 0.4, 0.8))


def agree(brain: Brain, ticks: int, seed: int) -> np.ndarray[tuple[int], np.dtype]:
    """Compare all states after each tick and return the last ones."""
    network = pack(brain, WIDTH)
    solo = SoloNetwork(network, WIDTH, TICK_S, ticks)
    bank = NetworkBank([network], WIDTH, TICK_S)
    rng = np.random.default_rng(seed)
    for tick in range(ticks):
        readings = rng.normal(0.0, 5.0, (1, WIDTH.inputs))
        expected = bank.step(readings, float(tick))
        assert solo.step(readings, float(tick)).tobytes() == expected.tobytes()
        assert solo.states.tobytes() == bank.states.tobytes()
    return solo.states


def test_random_brains_equal_those_of_a_bank(robot_of: Callable[[int], Robot]) -> None:
    for seed in range(100):
        agree(robot_of(seed).brain, 96, seed)


@pytest.mark.parametrize(
    "neurons",
    [
        (SQUEEZED,),
        (LINEAR,),
        (SWINGING,),
        (SQUEEZED, LINEAR),
        (SQUEEZED, SWINGING),
        (LINEAR, SWINGING),
        (SQUEEZED, LINEAR, SWINGING),
    ],
    ids=lambda neurons: "-".join(neuron.kind for neuron in neurons),
)
def test_every_mixture_of_neuron_types_equals_that_of_a_bank(
    neurons: tuple[Neuron, ...],
) -> None:
    edges = tuple(
        Connection(source, target, 0.3 + 0.2 * source - 0.4 * target)
        for source in range(len(neurons))
        for target in range(len(neurons))
    )
    agree(Brain(neurons, edges), 40, 1)


def test_growing_states_stop_at_the_limit() -> None:
    wild = Neuron("hidden", "Oscillator", 0, (1e-300, 0.3, 1e99))
    brain = Brain((LINEAR, wild), (Connection(0, 0, 1e300), Connection(1, 0, 0.5)))
    assert np.abs(agree(brain, 30, 2)).max() == STATE_LIMIT
