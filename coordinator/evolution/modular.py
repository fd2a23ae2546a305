"""Genes of modules with shared weights, the brain type ``modular``.

Every part has the genes of its own module. Crossover may join parts of two sets of
weights; mutation then makes one of them. See ``schema.robot.modular``.
"""

from collections.abc import Sequence
from typing import TypeVar

from schema.experiment.brains import NoParameters
from schema.parts import PartType
from schema.plugins.protocols import BrainRules, Branch, Draws, NeuronType
from schema.robot.brain import LAYERS, Layer, NeuronKinds
from schema.robot.genome import ConnectionGene, NeuronGene
from schema.robot.modular import (
    MODULE_KINDS,
    MODULE_NEURON,
    MODULE_NEURONS,
    WEIGHT,
    Role,
    place_of,
)

B = TypeVar("B", bound=Branch)

End = tuple[Layer, int]
"""Layer and offset of a neuron within its part."""
_STATES: tuple[Layer, ...] = ("output", "hidden")
_BIAS = MODULE_KINDS[MODULE_NEURON]
_BLANK = NeuronGene(MODULE_NEURON, (0.0,))


class Shared:
    """The numbers that all modules of a robot share, each drawn when first needed.

    Attributes:
        biases: by place of the neuron in its module.
        weights: by role.
    """

    def __init__(self, draws: Draws, branches: Sequence[Branch]) -> None:
        """Read what branches have; of several values one is drawn."""
        self._draws = draws
        biases: dict[int, list[float]] = {}
        weights: dict[Role, list[float]] = {}
        for branch in branches:
            own = zip(_STATES, (branch.outputs, branch.hidden), strict=True)
            for layer, genes in own:
                for offset, gene in enumerate(genes):
                    values = biases.setdefault(place_of(layer, offset), [])
                    _note(values, gene.parameters[0])
            for edge in branch.connections:
                end = branch.along(edge.path)
                if end is not None and (relation := _relation(branch, end)):
                    role = _role(branch, edge.source, relation, edge.target)
                    _note(weights.setdefault(role, []), edge.weight)
        self.biases = {role: draws.pick(found) for role, found in biases.items()}
        self.weights = {role: draws.pick(found) for role, found in weights.items()}

    def vary(self, epsilon: float) -> None:
        """Move all numbers towards random ones."""
        for place, bias in self.biases.items():
            (self.biases[place],) = self._draws.nearby(_BIAS, (bias,), epsilon)
        for role, weight in self.weights.items():
            (self.weights[role],) = self._draws.nearby((WEIGHT,), (weight,), epsilon)

    def write(self, branches: Sequence[Branch]) -> None:
        """Give each branch a module of these numbers."""
        for branch in branches:
            motors = len(branch.outputs)
            branch.outputs = self._neurons("output", motors)
            branch.hidden = self._neurons("hidden", MODULE_NEURONS - motors)
        for branch in branches:
            around = [branch, *branch.children.values()]
            if branch.parent is not None:
                around.append(branch.parent)
            branch.connections = tuple(
                self._connection(branch, source, end, target)
                for end in around
                for source in branch.neurons(*(LAYERS if end is branch else _STATES))
                for target in end.neurons(*_STATES)
            )

    def _neurons(self, layer: Layer, count: int) -> tuple[NeuronGene, ...]:
        genes = []
        for offset in range(count):
            place = place_of(layer, offset)
            if place not in self.biases:
                (self.biases[place],) = self._draws.values(_BIAS)
            genes.append(NeuronGene(MODULE_NEURON, (self.biases[place],)))
        return tuple(genes)

    def _connection(
        self, branch: B, source: End, end: B, target: End
    ) -> ConnectionGene:
        role = _role(branch, source, _relation(branch, end), target)
        if role not in self.weights:
            (self.weights[role],) = self._draws.values((WEIGHT,))
        path = branch.path_to(end)
        return ConnectionGene(source, path, target, self.weights[role])


class ModularGenes:
    """A module for each part, all of the same weights."""

    def __init__(self, _: NoParameters, _types: tuple[NeuronType, ...] = ()) -> None:
        self.neurons: NeuronKinds = MODULE_KINDS

    def outputs(self, _draws: Draws, part: PartType) -> tuple[NeuronGene, ...]:
        """Return neurons without bias; ``grow`` sets it."""
        return (_BLANK,) * part.outputs

    def grow(
        self,
        draws: Draws,
        new: Sequence[Branch],
        branches: Sequence[Branch],
        rules: BrainRules,  # noqa: ARG002 - the experiment has room for all modules
    ) -> None:
        """Add the modules of new parts, and random numbers that no part has yet."""
        old = [branch for branch in branches if branch not in new]
        Shared(draws, old).write(branches)

    def prune(
        self, draws: Draws, branches: Sequence[Branch], rules: BrainRules
    ) -> None:
        """Remove nothing: ``vary`` writes all genes again."""

    def vary(
        self,
        draws: Draws,
        branches: Sequence[Branch],
        rules: BrainRules,
        pruned: None,  # noqa: ARG002 - nothing
    ) -> None:
        """Take each number from either parent, and move it towards a random one."""
        shared = Shared(draws, branches)
        shared.vary(rules.epsilon)
        shared.write(branches)


def _note(values: list[float], value: float) -> None:
    if value not in values:
        values.append(value)


def _relation(branch: B, end: B) -> str:
    """Return what a part is to that at the end of a connection; nothing if far."""
    if end is branch:
        return "own"
    if end is branch.parent:
        return "child"
    return "parent" if end.parent is branch else ""


def _role(branch: Branch, source: End, relation: str, target: End) -> Role:
    """Return the role of a connection from a neuron of a part."""
    layer, kind = "state", relation
    if source[0] == "input":
        layer, kind = "input", branch.kind.name
    return layer, kind, place_of(*source), place_of(*target)
