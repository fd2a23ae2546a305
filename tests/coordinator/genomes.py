"""Genomes by hand, settings and draws of tests of variation."""

from typing import Any

import numpy as np

from coordinator.evolution.generation import generate
from coordinator.evolution.random_streams import BufferedRng
from schema.experiment.document import Experiment, Space, Variation, body_space
from schema.parts import BUILT_IN
from schema.robot.genome import Genome, NeuronGene, Node, walk
from schema.robot.ids import BirthId

TYPES = body_space(Space())
GREY = (0.5, 0.5, 0.5)
NEURON = NeuronGene("Simple", (0.0, 0.5))


def node(
    kind: str,
    *children: tuple[int, Node],
    slot: int = 0,
    **genes: Any,  # noqa: ANN401 - any gene
) -> Node:
    """Return a node with default parameters and a neuron for each motor."""
    part = BUILT_IN[kind]
    parameters = tuple(parameter.default for parameter in part.parameters)
    common = {"orientation": 0, "outputs": (NEURON,) * part.outputs, **genes}
    own_slot = -1 if part.is_root else slot
    return Node(kind, own_slot, parameters=parameters, children=children, **common)


def experiment(space: dict[str, Any] | None = None, **variation: Any) -> Experiment:  # noqa: ANN401 - any setting
    return Experiment(
        name="test", space=Space(**(space or {})), variation=Variation(**variation)
    )


def draws(seed: int = 0) -> BufferedRng:
    return BufferedRng(np.random.default_rng(seed))


def founder(seed: int, setting: Experiment | None = None) -> Genome:
    """Return a random genome."""
    birth = BirthId(0, seed % 2**32)
    return generate(np.random.default_rng(seed), setting or experiment(), birth)


def kinds(genome: Genome) -> list[str]:
    return [one.kind for one, _, _ in walk(genome)]
