"""Modules with shared weights in workers; formulas: ``schema.robot.modular``."""

from collections.abc import Sequence

import numpy as np

from schema.experiment.brains import NoParameters
from schema.plugins.protocols import NeuronType
from schema.robot.brain import Brain, NeuronKinds, Widths
from schema.robot.modular import MODULE_KINDS, SENSOR_GAIN
from worker.robot.banks import NetworkBank, PackedNetwork
from worker.robot.cpg import NUMBER_LIMIT


class ModularControl:
    """Brain type ``modular``: all modules of a robot are one network.

    Its states are the outputs y = (1 + x) / 2, 0 at birth.
    """

    def __init__(self, _: NoParameters, _types: tuple[NeuronType, ...] = ()) -> None:
        self.neurons: NeuronKinds = MODULE_KINDS

    def pack(self, brain: Brain, width: Widths) -> PackedNetwork:
        """Return a brain as arrays: x = 2 y - 1 is folded into weights and shift."""
        first = {"input": 0, "output": width.inputs}
        first["hidden"] = width.inputs + width.outputs
        weights = np.zeros((width.states, width.inputs + width.states))
        numbers, kinds = np.zeros((4, width.states)), np.zeros((2, width.states), bool)
        places: list[int] = []
        for neuron in brain.neurons:
            place = first[neuron.layer]
            first[neuron.layer] += 1
            places.append(place)
            if neuron.layer != "input":
                (bias,) = neuron.parameters
                numbers[:, place - width.inputs] = 0.0, -bias, 0.5, 0.5
                kinds[0, place - width.inputs] = True
        for edge in brain.connections:
            row = places[edge.target] - width.inputs
            weights[row, places[edge.source]] = edge.weight
        # Numbers of files may be far out of their ranges.
        for array in (weights, numbers):
            np.clip(array, -NUMBER_LIMIT, NUMBER_LIMIT, out=array)
        numbers[1] += weights[:, width.inputs :].sum(axis=1)
        weights[:, : width.inputs] *= SENSOR_GAIN
        weights[:, width.inputs :] *= 2.0
        return PackedNetwork(weights, numbers, kinds)

    def bank(
        self, packed: Sequence[PackedNetwork], width: Widths, tick_s: float
    ) -> NetworkBank:
        """Return networks that are updated together."""
        return NetworkBank(packed, width, tick_s)
