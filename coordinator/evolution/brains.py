"""Brain types in the coordinator: the half of each type that makes genes."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import lru_cache
from typing import Any, TypeVar

from coordinator.evolution.cpg import CpgGenes
from coordinator.evolution.network import NetworkGenes
from schema.errors import ExperimentError
from schema.experiment.brains import brain_half
from schema.experiment.document import Experiment
from schema.parts import PartType
from schema.plugins.origin import where_defined
from schema.plugins.protocols import BrainGenes, BrainRules, Branch, Draws, NeuronType
from schema.robot.brain import NeuronKinds
from schema.robot.genome import ConnectionGene, NeuronGene

T = TypeVar("T")

BUILT_IN: Mapping[str, Callable[[Any, tuple[NeuronType, ...]], BrainGenes]] = {
    "network": NetworkGenes,
    "cpg": CpgGenes,
}


@lru_cache(maxsize=64)
def brain_genes(experiment: Experiment) -> BrainGenes:
    """Return the brain type of an experiment.

    Raises:
        UnknownPlugin: no such brain type or neuron type.
        ExperimentError: one that breaks its contract, or wrong parameters.
    """
    found = brain_half(experiment.brain, experiment.space, BUILT_IN)
    return OwnGenes(found) if ":" in experiment.brain.type else found


class OwnGenes:
    """Brain type of a plug-in, whose genes are checked after each of its methods.

    Genomes share the tuples of genes: a list that a child changed in place would
    change its parent, so lists of genes become tuples.

    Attributes:
        where: the brain type is defined, for messages.
    """

    def __init__(self, brain: BrainGenes) -> None:
        self._brain = brain
        self.where = where_defined(type(brain))

    @property
    def neurons(self) -> NeuronKinds:
        """As of ``BrainGenes``, like the methods; these raise an ExperimentError."""
        return self._brain.neurons

    def outputs(self, draws: Draws, part: PartType) -> tuple[NeuronGene, ...]:
        """Return the output neurons of a new part."""
        return self._tuple("outputs", self._brain.outputs(draws, part), NeuronGene)

    def grow(
        self,
        draws: Draws,
        new: Sequence[Branch],
        branches: Sequence[Branch],
        rules: BrainRules,
    ) -> None:
        """Add hidden neurons and connections to new parts."""
        self._brain.grow(draws, new, branches, rules)
        self._check(branches)

    def prune(
        self, draws: Draws, branches: Sequence[Branch], rules: BrainRules
    ) -> object:
        """Mutate a child, first half."""
        pruned = self._brain.prune(draws, branches, rules)
        self._check(branches)
        return pruned

    def vary(
        self,
        draws: Draws,
        branches: Sequence[Branch],
        rules: BrainRules,
        pruned: object,
    ) -> None:
        """Mutate a child, second half."""
        self._brain.vary(draws, branches, rules, pruned)
        self._check(branches)

    def _check(self, branches: Iterable[Branch]) -> None:
        for branch in branches:
            branch.outputs = self._tuple("outputs", branch.outputs, NeuronGene)
            branch.hidden = self._tuple("hidden", branch.hidden, NeuronGene)
            branch.connections = self._tuple(
                "connections", branch.connections, ConnectionGene
            )

    def _tuple(self, name: str, found: Iterable[T], kind: type[T]) -> tuple[T, ...]:
        """Return genes as a tuple.

        Raises:
            ExperimentError: neither a tuple nor a list, or one with another object.
        """
        expected = f"brain.type: {self.where}: expected {name} as a tuple of "
        expected += f"{kind.__name__}, got "
        if not isinstance(found, tuple | list):
            raise ExperimentError(f"{expected}a {type(found).__name__}")
        for each in found:
            if not isinstance(each, kind):
                raise ExperimentError(f"{expected}one with a {type(each).__name__}")
            if isinstance(each, NeuronGene) and not isinstance(each.parameters, tuple):
                raise ExperimentError(
                    f"{expected}one with parameters as a "
                    f"{type(each.parameters).__name__}, not a tuple"
                )
        return tuple(found)


@lru_cache(maxsize=64)
def brain_rules(experiment: Experiment) -> BrainRules:
    """Return the settings of an experiment that brains keep."""
    variation = experiment.variation
    return BrainRules(
        max_hidden=experiment.space.max_hidden,
        p_connect_neurons=experiment.generation.p_connect_neurons,
        hidden_on=experiment.generation.hidden_on,
        p_delete_hidden_neuron=variation.p_delete_hidden_neuron,
        p_remove_brain_connection=variation.p_remove_brain_connection,
        epsilon=variation.brain_epsilon,
        hidden_rounding=variation.hidden_rounding,
    )
