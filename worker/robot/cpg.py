"""Coupled phase oscillators in workers; formulas: ``schema.robot.cpg``."""

from collections.abc import Sequence
from math import ceil, pi
from typing import NamedTuple

import numpy as np

from schema.plugins.protocols import NeuronType
from schema.robot.brain import Brain, NeuronKinds, Widths
from schema.robot.cpg import CpgParameters, cpg_neurons
from schema.robot.trace import Floats

LONGEST_STEP_S = 0.05
"""Longest step of the integration (Runge-Kutta of order 4)."""
NUMBER_LIMIT = 1e6
"""Bound on all numbers of a brain, so that phases stay finite."""


class PackedCpg(NamedTuple):
    """Oscillators of one robot, O of them; unused ones are 0.

    Attributes:
        coupling: (O, O) [rad/s], from each column to each row.
        numbers: (4, O): frequency [rad/s], phase offset [rad], half of the
            amplitude, centre.
    """

    coupling: Floats
    numbers: Floats


class CpgControl:
    """Brain type ``cpg``: an oscillator for each motor; sensors have no effect."""

    def __init__(
        self, parameters: CpgParameters, _: tuple[NeuronType, ...] = ()
    ) -> None:
        self.neurons: NeuronKinds = cpg_neurons(parameters)
        self._coupling = parameters.coupling

    def pack(self, brain: Brain, width: Widths) -> PackedCpg:
        """Return a brain as arrays; connections of other layers have no effect."""
        count = width.outputs
        coupling, numbers = np.zeros((count, count)), np.zeros((4, count))
        places: dict[int, int] = {}
        for index, neuron in enumerate(brain.neurons):
            if neuron.layer == "output":
                frequency, phase, amplitude, centre = neuron.parameters
                numbers[:, len(places)] = (
                    2.0 * pi * frequency,
                    2.0 * pi * phase,
                    0.5 * amplitude,
                    centre,
                )
                places[index] = len(places)
        for edge in brain.connections:
            if edge.source in places and edge.target in places:
                weight = self._coupling * edge.weight
                coupling[places[edge.target], places[edge.source]] = weight
        return PackedCpg(
            np.clip(coupling, -NUMBER_LIMIT, NUMBER_LIMIT),
            np.clip(numbers, -NUMBER_LIMIT, NUMBER_LIMIT),
        )

    def bank(
        self, packed: Sequence[PackedCpg], width: Widths, tick_s: float
    ) -> "CpgBank":
        """Return oscillators that are updated together."""
        return CpgBank(packed, width, tick_s)


class CpgBank:
    """Oscillators of R robots; states (R, O): deviations from phase offsets [rad]."""

    def __init__(
        self, packed: Sequence[PackedCpg], width: Widths, tick_s: float
    ) -> None:
        count = width.outputs
        self._coupling = np.zeros((len(packed), count, count))
        numbers = np.zeros((4, len(packed), count))
        for row, each in enumerate(packed):
            self._coupling[row] = each.coupling
            numbers[:, row] = each.numbers
        self._frequency, self._offset, self._amplitude, self._centre = numbers
        self.states: Floats = np.zeros((len(packed), count))
        self._steps = ceil(tick_s / LONGEST_STEP_S)
        self._step_s = tick_s / self._steps

    def step(self, _readings: Floats, age_ticks: Floats | float) -> Floats:
        """Return the outputs at this tick, (R, O), after a tick's time has passed.

        Robots are born at their first tick, where no time has passed.

        Ages are (R, 1) ticks since each robot's birth, or one number.
        """
        phase = self.states
        for _ in range(self._steps):
            phase = self._after_step(phase)
        np.copyto(self.states, phase, where=np.asarray(age_ticks) > 0.0)
        waves = np.sin(self.states + self._offset)
        outputs: Floats = self._centre + self._amplitude * waves
        return outputs

    def _after_step(self, phase: Floats) -> Floats:
        half = 0.5 * self._step_s
        first = self._rate(phase)
        second = self._rate(phase + half * first)
        third = self._rate(phase + half * second)
        fourth = self._rate(phase + self._step_s * third)
        total = first + 2.0 * second + 2.0 * third + fourth
        return phase + self._step_s / 6.0 * total

    def _rate(self, phase: Floats) -> Floats:
        differences = phase[:, np.newaxis, :] - phase[:, :, np.newaxis]
        pull: Floats = (self._coupling * np.sin(differences)).sum(axis=2)
        return self._frequency + pull
