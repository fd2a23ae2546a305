"""Genes of the thesis's recurrent network, the brain type ``network``.

Source: Hupkes 2016, sections 4.4.2 and 4.4.6; the code of the original.
"""

from collections.abc import Sequence

from coordinator.evolution.brain_generation import random_neuron, wire
from coordinator.evolution.brain_mutation import (
    add_connections,
    add_hidden_neurons,
    delete_connections,
    delete_hidden_neurons,
    vary_neurons,
)
from schema.experiment.brains import NoParameters, kinds_of
from schema.parts import PartType
from schema.plugins.protocols import BrainRules, Branch, Draws, NeuronType
from schema.robot.brain import NeuronKinds
from schema.robot.genome import NeuronGene


class NetworkGenes:
    """Random types of neurons, random connections between any of them."""

    def __init__(self, _: NoParameters, types: tuple[NeuronType, ...]) -> None:
        self.neurons: NeuronKinds = kinds_of(types)
        self._types = tuple(self.neurons.items())

    def outputs(self, draws: Draws, part: PartType) -> tuple[NeuronGene, ...]:
        """Return a random neuron for each motor."""
        return tuple(random_neuron(draws, self._types) for _ in range(part.outputs))

    def grow(
        self,
        draws: Draws,
        new: Sequence[Branch],
        branches: Sequence[Branch],
        rules: BrainRules,
    ) -> None:
        """Add hidden neurons, and connections from the neurons of new parts."""
        if len(new) == len(branches):
            self._add_hidden_of_robot(draws, branches, rules)
        else:
            for part in new:
                self._add_hidden_of_part(draws, part, branches, rules)
        wire(draws, new, branches, rules.p_connect_neurons)

    def _add_hidden_of_robot(
        self, draws: Draws, branches: Sequence[Branch], rules: BrainRules
    ) -> None:
        """Add 0..max_hidden neurons."""
        hosts = branches
        if rules.hidden_on == "wired":
            hosts = [b for b in branches if b.kind.inputs or b.outputs]
        for _ in range(draws.below(rules.max_hidden + 1)):
            draws.pick(hosts).hidden += (random_neuron(draws, self._types),)

    def _add_hidden_of_part(
        self, draws: Draws, part: Branch, branches: Sequence[Branch], rules: BrainRules
    ) -> None:
        """Add the share of 0..max_hidden neurons that falls to one part."""
        others = len(branches) - 1
        # Rounded half up.
        share = (2 * draws.below(rules.max_hidden + 1) + others) // (2 * others)
        room = rules.max_hidden - sum(len(branch.hidden) for branch in branches)
        part.hidden = tuple(
            random_neuron(draws, self._types) for _ in range(min(share, room))
        )

    def prune(
        self, draws: Draws, branches: Sequence[Branch], rules: BrainRules
    ) -> tuple[int, int]:
        """Delete hidden neurons and connections; return their numbers before."""
        hidden = sum(len(branch.hidden) for branch in branches)
        connections = sum(len(branch.connections) for branch in branches)
        delete_hidden_neurons(draws, branches, rules.p_delete_hidden_neuron)
        delete_connections(draws, branches, rules.p_remove_brain_connection)
        return hidden, connections

    def vary(
        self,
        draws: Draws,
        branches: Sequence[Branch],
        rules: BrainRules,
        pruned: tuple[int, int],
    ) -> None:
        """Vary neurons, then add hidden neurons and connections."""
        hidden, connections = pruned
        vary_neurons(draws, branches, rules.epsilon, self.neurons)
        add_hidden_neurons(draws, branches, hidden, rules, self.neurons)
        add_connections(draws, branches, connections, rules)
