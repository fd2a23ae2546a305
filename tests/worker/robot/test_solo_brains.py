"""A solo network equals a bank of one, to the last bit."""

from collections.abc import Callable

import numpy as np
import pytest

from schema.experiment.brains import widths
from schema.experiment.document import Space
from schema.robot.brain import Brain, Connection, Neuron
from schema.robot.robot import Robot
from worker.robot.banks import NetworkBank
from worker.robot.brains import SoloNetwork, pack
from worker.robot.own_neurons import STATE_LIMIT

WIDTH = widths(Space())
TICK_S = 0.125
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


def test_growing_state_stops_at_the_limit() -> None:
    wild = Neuron("hidden", "Oscillator", 0, (1e-300, 0.3, 1e99))
    brain = Brain((LINEAR, wild), (Connection(0, 0, 1e300), Connection(1, 0, 0.5)))
    assert np.abs(agree(brain, 30, 2)).max() == STATE_LIMIT
