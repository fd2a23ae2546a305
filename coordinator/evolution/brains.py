"""Brain types in the coordinator: the half of each type that makes genes."""

from collections.abc import Callable, Mapping
from functools import lru_cache
from typing import Any

from coordinator.evolution.cpg import CpgGenes
from coordinator.evolution.modular import ModularGenes
from coordinator.evolution.network import NetworkGenes
from schema.experiment.brains import brain_half
from schema.experiment.document import Experiment
from schema.plugins.protocols import BrainGenes, BrainRules, NeuronType

BUILT_IN: Mapping[str, Callable[[Any, tuple[NeuronType, ...]], BrainGenes]] = {
    "network": NetworkGenes,
    "cpg": CpgGenes,
    "modular": ModularGenes,
}


@lru_cache(maxsize=64)
def brain_genes(experiment: Experiment) -> BrainGenes:
    """Return the brain type of an experiment.

    Raises:
        UnknownPlugin: no such brain type or neuron type.
        ExperimentError: one that breaks its contract, or wrong parameters.
    """
    return brain_half(experiment.brain, experiment.space, BUILT_IN)


@lru_cache(maxsize=64)
def brain_rules(experiment: Experiment) -> BrainRules:
    """Return the settings of an experiment that brains keep."""
    variation = experiment.variation
    return BrainRules(
        max_hidden=experiment.space.max_hidden,
        p_connect_neurons=experiment.generation.p_connect_neurons,
        p_delete_hidden_neuron=variation.p_delete_hidden_neuron,
        p_remove_brain_connection=variation.p_remove_brain_connection,
        epsilon=variation.brain_epsilon,
    )
