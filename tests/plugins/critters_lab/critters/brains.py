"""A brain type: one beat for the whole body, and a phase for each motor."""

from collections.abc import Sequence

import msgspec
import numpy as np
from numpy.typing import NDArray

import revolve as rv

Floats = NDArray[np.float64]


class Beat:
    """All motors swing at one frequency, each with an inherited phase."""

    class Parameters(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
        """The table ``[brain.parameters]``."""

        frequency_hz: float = 1.0

    def __init__(self, parameters: Parameters, neuron_types: object) -> None:
        """Keep the parameters; there are no other neurons."""
        self.neurons = {"Phase": (rv.Parameter("phase", 0.0, 1.0, 0.0),)}
        self.frequency_hz = parameters.frequency_hz

    def outputs(self, draws: rv.Draws, part: rv.PartType) -> tuple[rv.NeuronGene, ...]:
        """Return a random phase for each motor of a new part."""
        phase = self.neurons["Phase"]
        return tuple(
            rv.NeuronGene("Phase", draws.values(phase)) for _ in range(part.outputs)
        )

    def grow(self, draws: object, new: object, branches: object, rules: object) -> None:
        """Add nothing: there are no connections."""

    def prune(self, draws: object, branches: object, rules: object) -> None:
        """Remove nothing."""

    def vary(
        self,
        draws: rv.Draws,
        branches: Sequence[rv.Branch],
        rules: rv.BrainRules,
        pruned: object,
    ) -> None:
        """Move all phases towards random ones."""
        phase = self.neurons["Phase"]
        for branch in branches:
            branch.outputs = tuple(
                rv.NeuronGene(
                    "Phase", draws.nearby(phase, gene.parameters, rules.epsilon)
                )
                for gene in branch.outputs
            )

    def pack(self, brain: rv.Brain, width: rv.Widths) -> Floats:
        """Return the phases as an array of fixed width, (O,)."""
        packed = np.zeros(width.outputs)
        motors = [each for each in brain.neurons if each.layer == "output"]
        for place, neuron in enumerate(motors):
            packed[place] = neuron.parameters[0]
        return packed

    def bank(
        self, packed: Sequence[Floats], width: rv.Widths, tick_s: float
    ) -> "Beats":
        """Return the brains of R robots."""
        phases = np.array(packed).reshape(-1, width.outputs)
        return Beats(phases, self.frequency_hz * tick_s)


class Beats:
    """Brains of R robots; ``states`` (R, 1) are their times in periods."""

    def __init__(self, phases: Floats, turn: float) -> None:
        """Start all robots at 0; ``turn`` is the change of each tick."""
        self.phases, self.turn = phases, turn
        self.states = np.zeros((len(phases), 1))

    def step(self, readings: Floats, age_ticks: object) -> Floats:
        """Return the outputs (R, O): triangular waves from 0 to 1."""
        self.states += self.turn
        swing: Floats = np.abs(2.0 * ((self.states + self.phases) % 1.0) - 1.0)
        return swing
