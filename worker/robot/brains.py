"""Brain types in workers: the half of each type that ticks, and robots off-line."""

from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import Any, Protocol

import numpy as np

from schema.errors import SimulationDiverged
from schema.experiment.brains import NoParameters, brain_half, kinds_of, widths
from schema.experiment.document import BrainSection, Space
from schema.experiment.settings import ArenaSettings, EvaluationSettings
from schema.plugins.origin import where_defined
from schema.plugins.protocols import Bank as BankProtocol
from schema.plugins.protocols import BrainControl, NeuronType
from schema.robot.brain import (
    Brain,
    NeuronKinds,
    Widths,
    check_neurons,
    check_widths,
)
from schema.robot.results import Floats
from worker.robot.check_controls import check_controls
from worker.robot.controller import Bank, Network, SoloNetwork, pack
from worker.robot.cpg import CpgControl


class NetworkControl:
    """The thesis's recurrent network, of any neuron types."""

    def __init__(self, _: NoParameters, types: tuple[NeuronType, ...]) -> None:
        self.neurons: NeuronKinds = kinds_of(types)
        self._types = {kind.name: kind for kind in types}
        self._values = max(kind.states for kind in types)

    def pack(self, brain: Brain, width: Widths) -> Network:
        """Return a brain as arrays."""
        return pack(brain, width, self._types)

    def bank(self, packed: Sequence[Network], width: Widths, tick_s: float) -> Bank:
        """Return networks that are updated together."""
        return Bank(packed, width, tick_s, self._values)


BUILT_IN: Mapping[str, Callable[[Any, tuple[NeuronType, ...]], BrainControl]] = {
    "network": NetworkControl,
    "cpg": CpgControl,
}


class Solo(Protocol):
    """Brain of a robot that lives alone, updated from birth on.

    Attributes:
        readings: (1, I) sensor readings, which the caller writes before each tick.
    """

    readings: Floats

    def step(self, tick: int) -> Floats:
        """Update the brain and return its outputs, (O,), not clipped.

        Args:
            tick: number of the tick, 0 at birth.
        """


class SoloBank:
    """A bank of one brain, of any type."""

    def __init__(self, bank: BankProtocol, inputs: int, tick_s: float) -> None:
        self.readings: Floats = np.zeros((1, inputs))
        self._bank, self._tick_s = bank, tick_s

    def step(self, tick: int) -> Floats:
        """Update the brain and return its outputs.

        Raises:
            SimulationDiverged: a state or output that is not finite.
        """
        outputs = np.asarray(self._bank.step(self.readings, float(tick)))
        if not (np.isfinite(self._bank.states).all() and np.isfinite(outputs).all()):
            raise SimulationDiverged(
                f"brain diverged by {tick * self._tick_s:.3f} s: state not finite"
            )
        found: Floats = outputs[0]
        return found


class Controls:
    """Brains of one experiment in a worker.

    Attributes:
        width: greatest numbers of neurons.
        neurons: types of output and hidden neurons by name.
        is_checked: states may be not finite, because the code is a user's.
    """

    def __init__(self, brain: BrainSection, space: Space, tick_s: float) -> None:
        """Load the brain type.

        Args:
            brain: names it.
            space: limits and neuron types.
            tick_s: time between two ticks [s].

        Raises:
            UnknownPlugin: no such brain type or neuron type.
            ExperimentError: one that breaks its contract, or wrong parameters.
        """
        self.width = widths(space)
        self.is_checked = any(":" in path for path in (brain.type, *space.neuron_types))
        self._control = brain_half(brain, space.neuron_types, BUILT_IN)
        self._tick_s = tick_s
        self.neurons = self._control.neurons
        if self.is_checked:
            check_controls(self, f"brain.type: {where_defined(type(self._control))}")
        self._rest = self.bank(()).states.shape[1]

    def pack(self, brain: Brain) -> Any:  # noqa: ANN401 - a brain type's own
        """Return a checked brain in the form that ``bank`` and ``solo`` take.

        Raises:
            InvalidRobot: neurons of other types than the experiment's, or too many.
        """
        check_neurons(brain, self.neurons)
        check_widths(brain, self.width)
        return self._control.pack(brain, self.width)

    def bank(self, packed: Sequence[Any]) -> BankProtocol:
        """Return brains at rest that are updated together."""
        return self._control.bank(packed, self.width, self._tick_s)

    def rest(self) -> Floats:
        """Return the states of one brain at birth."""
        return np.zeros(self._rest)

    def solo(self, brain: Brain, ticks: int) -> Solo:
        """Return the brain of a robot that lives alone.

        Args:
            brain: a checked brain.
            ticks: greatest number of ticks.

        Raises:
            InvalidRobot: as in ``pack``.
        """
        packed = self.pack(brain)
        if isinstance(packed, Network) and not packed.own:
            return SoloNetwork(packed, self.width, self._tick_s, ticks)
        return SoloBank(self.bank([packed]), self.width.inputs, self._tick_s)


@lru_cache(maxsize=64)
def controls_of(settings: EvaluationSettings | ArenaSettings) -> Controls:
    """Return the brains of a request's experiment; see ``Controls``."""
    clock = settings.simulation
    tick_s = clock.brain_steps * clock.timestep_s
    return load_controls(settings.brain, settings.space, tick_s)


@lru_cache(maxsize=64)
def load_controls(brain: BrainSection, space: Space, tick_s: float) -> Controls:
    """Return the brains of an experiment; see ``Controls``."""
    return Controls(brain, space, tick_s)
