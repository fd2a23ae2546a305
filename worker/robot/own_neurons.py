"""Neurons of users' types in a batch of networks.

All neurons of one type are computed by one call of its ``step``.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import numpy.typing as npt

from schema.errors import SimulationDiverged, cut, error_text
from schema.plugins.check_neuron_type import states_problem
from schema.plugins.protocols import NeuronType
from schema.robot.neurons import Tick
from schema.robot.trace import Floats

STATE_LIMIT = 1e6
"""Bound on the states of neurons, which may feed back on themselves."""


class OwnNeuron(NamedTuple):
    """Neuron of a user's type: its place among a network's states, its parameters."""

    kind: NeuronType
    row: int
    parameters: tuple[float, ...]


class _Group(NamedTuple):
    """The N neurons of one type.

    Attributes:
        robots: (N,) rows of their networks in the batch.
        places: (K, N) columns of their states.
        parameters: (P, N).
    """

    kind: NeuronType
    robots: npt.NDArray[np.intp]
    places: npt.NDArray[np.intp]
    parameters: Floats


class OwnNeurons:
    """All neurons of users' types in a batch."""

    def __init__(self, networks: Sequence[Sequence[OwnNeuron]], states: int) -> None:
        """Sort the neurons by type.

        ``states`` is S, the number of neurons of a network; column k S + s holds state
        k of neuron s.
        """
        found: dict[str, list[tuple[int, OwnNeuron]]] = {}
        for robot, neurons in enumerate(networks):
            for neuron in neurons:
                found.setdefault(neuron.kind.name, []).append((robot, neuron))
        self._groups = []
        for entries in found.values():
            kind = entries[0][1].kind
            rows = np.array([neuron.row for _, neuron in entries], dtype=np.intp)
            values = [neuron.parameters for _, neuron in entries]
            numbers = np.array(values, dtype=np.float64).reshape(len(entries), -1)
            self._groups.append(
                _Group(
                    kind,
                    np.array([robot for robot, _ in entries], dtype=np.intp),
                    rows + states * np.arange(kind.states)[:, np.newaxis],
                    np.ascontiguousarray(numbers.T),
                )
            )
        self._results: list[Floats] = []

    def update(
        self, sums: Floats, states: Floats, age_ticks: Floats | float, tick_s: float
    ) -> None:
        """Compute the next states of all these neurons; ``write`` stores them.

        Sums, (R, S), are weighted ones of readings and previous states, (R, K S); ages
        are (R, 1) ticks since each robot's birth, or one number.

        Raises:
            SimulationDiverged: the code of a type raised, or gave no such array.
        """
        ages = np.broadcast_to(np.asarray(age_ticks) * tick_s, (len(sums), 1))[:, 0]
        self._results = []
        for kind, robots, places, parameters in self._groups:
            tick = Tick(ages[robots], tick_s)
            mine, inputs = states[robots, places], sums[robots, places[0]]
            try:
                result = np.asarray(kind.step(mine, inputs, parameters, tick))
            except Exception as error:
                story = cut(error_text(error))
                raise SimulationDiverged(
                    f"neuron type {kind.name} raised {story}"
                ) from error
            if problem := states_problem(result, mine.shape):
                raise SimulationDiverged(f"neuron type {kind.name}: {problem}")
            self._results.append(result)

    def write(self, outputs: Floats, states: Floats) -> None:
        """Store the computed states.

        The outputs (R, S) of the present tick get the first ones, ``states`` (R, K S)
        the others.
        """
        for group, result in zip(self._groups, self._results, strict=True):
            outputs[group.robots, group.places[0]] = result[0]
            others = np.clip(result[1:], -STATE_LIMIT, STATE_LIMIT)
            states[group.robots, group.places[1:]] = others
