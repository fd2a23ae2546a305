"""The thesis's neuron types as objects that compute; formulas: ``schema.robot.brain``.

Workers compute these three faster and together, with results that are equal up to
rounding (tests/worker/robot/test_neuron_types.py).
"""

from collections.abc import Callable
from dataclasses import dataclass
from math import pi
from typing import NamedTuple

import numpy as np

from schema.parts import Parameter
from schema.robot.brain import NEURON_TYPES
from schema.robot.trace import Floats

SHORTEST_PERIOD_S = 1e-6
"""Least period of an oscillator, against a division by zero."""


class Tick(NamedTuple):
    """Time of a brain tick.

    Attributes:
        age_s: (N,) ages of the robots that own the neurons, 0 at the first tick [s].
        dt_s: time since the previous tick [s].
    """

    age_s: Floats
    dt_s: float


@dataclass(frozen=True, slots=True)
class StatelessNeuron:
    """Neuron type whose output follows from inputs, parameters and age.

    Attributes:
        output: (N,) from inputs (N,), parameters (P, N) and the tick.
        states: its only state is the output.
    """

    name: str
    parameters: tuple[Parameter, ...]
    output: Callable[[Floats, Floats, Tick], Floats]
    states: int = 1

    def step(
        self, state: Floats, inputs: Floats, parameters: Floats, tick: Tick
    ) -> Floats:
        """Return the next states, (1, N)."""
        return self.output(inputs, parameters, tick).reshape(state.shape)


def _simple(inputs: Floats, parameters: Floats, _tick: Tick) -> Floats:
    bias, gain = parameters
    output: Floats = gain * (inputs - bias)
    return output


def _sigmoid(inputs: Floats, parameters: Floats, tick: Tick) -> Floats:
    # 1 / (1 + exp(-a)) = (1 + tanh(a / 2)) / 2, which cannot overflow.
    return 0.5 + 0.5 * np.tanh(0.5 * _simple(inputs, parameters, tick))


def _oscillator(_inputs: Floats, parameters: Floats, tick: Tick) -> Floats:
    period, phase_offset, amplitude = parameters
    turns = tick.age_s / np.maximum(period, SHORTEST_PERIOD_S) - phase_offset
    output: Floats = 0.5 + 0.5 * amplitude * np.sin(2.0 * pi * turns)
    return output


BUILT_IN_NEURONS = {
    name: StatelessNeuron(name, NEURON_TYPES[name], output)
    for name, output in (
        ("Simple", _simple),
        ("Sigmoid", _sigmoid),
        ("Oscillator", _oscillator),
    )
}
"""The thesis's neuron types by name."""
