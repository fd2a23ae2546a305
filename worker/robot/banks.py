"""Brains that are updated together: networks as arrays; code of users, guarded.

All networks of a batch have the widths of the experiment's limits, whatever robots
are in it, and each is one slice of every array. A robot's outputs are therefore
equal to the last bit alone, in any batch and at any place in it
(tests/worker/robot/test_brains.py). Formulas: ``schema.robot.brain``.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import numpy.typing as npt

from schema.errors import SimulationDiverged, cut, error_text
from schema.plugins.protocols import Bank
from schema.robot.brain import Widths
from schema.robot.trace import Floats
from worker.robot.own_neurons import STATE_LIMIT, OwnNeuron, OwnNeurons

Mask = npt.NDArray[np.bool_]
LOWEST, HIGHEST = np.array(-STATE_LIMIT), np.array(STATE_LIMIT)
"""Bounds on the states of neurons."""
_DIVERGED = "brain diverged: state not finite"


@dataclass(frozen=True, slots=True)
class PackedNetwork:
    """Brain as arrays: S states (outputs, then hidden), I inputs.

    The next state of a neuron of the thesis's types is
    scale * f(weights . sources + frequency * age - shift) + offset, where f is tanh
    for a sigmoid, sine for an oscillator and the identity for a linear neuron; gains
    are multiplied into the weights. That of a neuron of a user's type depends on
    weights . sources.

    Attributes:
        weights: (S, I + S), from inputs and previous states to each neuron.
        numbers: (4, S): frequency [rad/s], shift, scale, offset.
        kinds: (2, S): whether it is a sigmoid, whether it is an oscillator.
    """

    weights: Floats
    numbers: Floats
    kinds: Mask
    own: tuple[OwnNeuron, ...] = ()


class NetworkBank:
    """R networks that are updated together; row r belongs to robot r.

    Attributes:
        states: (R, K S) outputs and hidden states after the last tick, then the other
            states of neurons of users' types, of which K is the greatest number of a
            neuron; may be copied and written to save, move
            and restore robots.
    """

    def __init__(
        self,
        networks: Sequence[PackedNetwork],
        width: Widths,
        tick_s: float,
        values: int = 1,
    ) -> None:
        count, states = len(networks), width.states
        self._tick_s = tick_s
        self._weights = np.empty((count, states, width.inputs + states))
        numbers = np.empty((4, count, states))
        kinds = np.empty((2, count, states), dtype=np.bool_)
        for row, network in enumerate(networks):
            self._weights[row] = network.weights
            numbers[:, row] = network.numbers
            kinds[:, row] = network.kinds
        self._frequency, self._shift, self._scale, self._offset = numbers
        self._is_sigmoid, self._is_oscillator = kinds
        self._has_sigmoids = bool(kinds[0].any())
        self._has_oscillators = bool(kinds[1].any())
        # Inputs and previous states side by side, as the weights expect them.
        memory = np.zeros((count, width.inputs + values * states, 1))
        self._sources = memory[:, : width.inputs + states]
        self._readings = memory[:, : width.inputs, 0]
        self.states = memory[:, width.inputs :, 0]
        self._first_states = self.states[:, :states]
        self._own: OwnNeurons | None = None
        if any(network.own for network in networks):
            self._own = OwnNeurons([network.own for network in networks], states)
        self._sums = np.empty((count, states, 1))
        self._next = self._sums[:, :, 0]
        self._other = np.empty((count, states))
        self._outputs = self.states[:, : width.outputs]

    def step(self, readings: Floats, age_ticks: Floats | float) -> Floats:
        """Update all networks once; see ``schema.plugins.protocols.Bank``.

        Outputs are finite, and a view that the next tick overwrites.
        """
        new, other = self._next, self._other
        self._readings[...] = readings
        np.matmul(self._weights, self._sources, out=self._sums)
        if self._own is not None:
            self._own.update(new, self.states, age_ticks, self._tick_s)
        # Without oscillators, all frequencies are 0.
        if self._has_oscillators:
            np.multiply(self._frequency, age_ticks * self._tick_s, out=other)
            np.add(new, other, out=new)
        np.subtract(new, self._shift, out=new)
        if self._has_sigmoids:
            np.tanh(new, out=other)
            np.putmask(new, self._is_sigmoid, other)
        if self._has_oscillators:
            np.sin(new, out=other)
            np.putmask(new, self._is_oscillator, other)
        np.multiply(new, self._scale, out=new)
        np.add(new, self._offset, out=new)
        if self._own is not None:
            self._own.write(new, self.states)
        np.maximum(new, LOWEST, out=new)
        np.minimum(new, HIGHEST, out=self._first_states)
        return self._outputs


class GuardedBank:
    """Brains of R robots that run code of users; row r belongs to robot r.

    A robot whose brain raises fails alone: brains are equal alone and in a batch, to
    the last bit, so if a batch raises, each brain is computed alone. At the last tick,
    the rows of ``failed`` did so, with outputs of 0.
    """

    def __init__(
        self, bank: Callable[[Sequence[Any]], Bank], packed: Sequence[Any], outputs: int
    ) -> None:
        self._bank_of, self._packed, self._width = bank, packed, outputs
        self._bank = bank(packed)
        self.failed: dict[int, str] = {}

    @property
    def states(self) -> Floats:
        """All states, (R, K)."""
        return self._bank.states

    def step(self, readings: Floats, age_ticks: Floats | float) -> Floats:
        """Update all brains once; see ``schema.plugins.protocols.Bank``."""
        self.failed = {}
        before = self.states.copy()
        try:
            return self._outputs(self._bank.step(readings, age_ticks), len(readings))
        except Exception:  # noqa: BLE001 - any fault of a user's code
            return self._step_alone(before, readings, age_ticks)

    def _outputs(self, returned: object, robots: int) -> Floats:
        """Return what ``step`` of a bank returned, (R, O); raise if it is not that."""
        numbers = np.asarray(returned).astype(
            np.float64, casting="same_kind", copy=False
        )
        if numbers.shape != (robots, self._width):
            raise ValueError(
                f"step must return (R, O) = {(robots, self._width)}, got "
                f"{numbers.shape}"
            )
        return numbers

    def _step_alone(
        self, before: Floats, readings: Floats, age_ticks: Floats | float
    ) -> Floats:
        """Update each brain alone, from the states before the tick."""
        count = len(self._packed)
        outputs = np.zeros((count, self._width))
        ages = np.broadcast_to(age_ticks, (count, 1))
        for row, packed in enumerate(self._packed):
            alone, bank = slice(row, row + 1), self._bank_of([packed])
            bank.states[...] = before[alone]
            try:
                outputs[alone] = self._outputs(
                    bank.step(readings[alone], ages[alone]), 1
                )
            except Exception as error:  # noqa: BLE001 - any fault of a user's code
                self.failed[row] = f"brain failed: {story_of(error)}"
            self.states[alone] = bank.states
        return outputs


def story_of(error: Exception) -> str:
    """Return why a user's brain failed, as the end of a message of one line."""
    if isinstance(error, SimulationDiverged):
        return str(error)
    return cut(error_text(error))


def broken_rows(bank: Bank, outputs: Floats) -> dict[int, str]:
    """Return why brains failed, or are no longer finite, by row, ascending."""
    if not isinstance(bank, GuardedBank):
        return {}
    is_finite = np.isfinite(bank.states).all(axis=1)
    is_finite &= np.isfinite(outputs).all(axis=1)
    diverged = dict.fromkeys(np.flatnonzero(~is_finite).tolist(), _DIVERGED)
    return dict(sorted((diverged | bank.failed).items()))
