"""Genes of modules with shared weights, the brain type ``modular``.

Every part has the genes of its own module. Crossover may join parts of two sets of
weights; mutation then makes one of them. See ``schema.robot.modular``.
"""

from collections.abc import Iterator, Sequence
from typing import TypeVar

from schema.experiment.brains import NoParameters
from schema.parts import PartType
from schema.plugins.protocols import BrainRules, Branch, Draws, NeuronType
from schema.robot.brain import Layer, NeuronKinds
from schema.robot.genome import ConnectionGene, NeuronGene
from schema.robot.modular import (
    MODULE_KINDS,
    MODULE_NEURON,
    MODULE_NEURONS,
    WEIGHT,
    Role,
)

B = TypeVar("B", bound=Branch)

End = tuple[Layer, int]
"""Layer and offset of a neuron within its part."""
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
            for place, gene in enumerate((*branch.outputs, *branch.hidden)):
                _note(biases.setdefault(place, []), gene.parameters[0])
            genes = {
                (gene.source, gene.path, gene.target): gene.weight
                for gene in branch.connections
            }
            for role, source, path, target in _connections(branch):
                weight = genes.get((source, path, target))
                if weight is not None:
                    _note(weights.setdefault(role, []), weight)
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
            genes = tuple(map(self._neuron, range(MODULE_NEURONS)))
            motors = len(branch.outputs)
            branch.outputs, branch.hidden = genes[:motors], genes[motors:]
        for branch in branches:
            branch.connections = tuple(
                ConnectionGene(source, path, target, self._weight(role))
                for role, source, path, target in _connections(branch)
            )

    def _neuron(self, place: int) -> NeuronGene:
        if place not in self.biases:
            (self.biases[place],) = self._draws.values(_BIAS)
        return NeuronGene(MODULE_NEURON, (self.biases[place],))

    def _weight(self, role: Role) -> float:
        if role not in self.weights:
            (self.weights[role],) = self._draws.values((WEIGHT,))
        return self.weights[role]


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


def _connections(branch: B) -> Iterator[tuple[Role, End, tuple[int, ...], End]]:
    """Yield role, source, path and target of the connections from a part's neurons."""
    targets = branch.neurons("output", "hidden")
    for place, source in enumerate(branch.neurons("input")):
        for at, target in enumerate(targets):
            yield ("input", branch.kind.name, place, at), source, (), target
    others = [("own", branch), *(("parent", each) for each in branch.children.values())]
    if branch.parent is not None:
        others.append(("child", branch.parent))
    for relation, other in others:
        path = branch.path_to(other)
        for place, source in enumerate(targets):
            for at, target in enumerate(other.neurons("output", "hidden")):
                yield ("state", relation, place, at), source, path, target
