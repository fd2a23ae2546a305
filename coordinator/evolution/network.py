"""Genes of the thesis's recurrent network, the brain type ``network``.

``NetworkGenes`` calls the steps of mutation in order; each changes a tree in place and
keeps every restriction. Source: Hupkes 2016, sections 4.4.2 and 4.4.6; the code of the
original. One of its errors is avoided: deleting a hidden neuron redirects no other
connection.
"""

from collections.abc import Iterable, Sequence
from decimal import Decimal
from typing import TypeVar

from msgspec.structs import astuple, replace

from schema.experiment.brains import NoParameters, kinds_of
from schema.parts import Parameter, PartType
from schema.plugins.protocols import BrainRules, Branch, Draws, NeuronType
from schema.robot.brain import Layer, NeuronKinds
from schema.robot.genome import ConnectionGene, NeuronGene

B = TypeVar("B", bound=Branch)

Types = Sequence[tuple[str, tuple[Parameter, ...]]]
"""Names and parameters of neuron types."""

_HALF = Decimal("0.5")


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
            for _ in range(draws.below(rules.max_hidden + 1)):
                draws.pick(branches).hidden += (random_neuron(draws, self._types),)
        else:
            for part in new:
                self._add_hidden_of_part(draws, part, branches, rules)
        wire(draws, new, branches, rules.p_connect_neurons)

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
        """Delete hidden neurons and connections; return how many of each there were."""
        hidden = connections = 0
        for branch in branches:
            hidden += len(branch.hidden)
            connections += len(branch.connections)
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


def random_neuron(draws: Draws, types: Types) -> NeuronGene:
    """Return an output or hidden neuron of uniform type with uniform parameters."""
    kind, parameters = draws.pick(types)
    return NeuronGene(kind, draws.values(parameters))


def endpoints(
    branches: Iterable[B], *layers: Layer
) -> list[tuple[B, tuple[Layer, int]]]:
    """Return all neurons of some layers as ends of connections."""
    return [(branch, end) for branch in branches for end in branch.neurons(*layers)]


def connect(
    draws: Draws,
    source: tuple[B, tuple[Layer, int]],
    target: tuple[B, tuple[Layer, int]],
) -> ConnectionGene:
    """Return a connection of random weight from one neuron to another."""
    path = source[0].path_to(target[0])
    return ConnectionGene(source[1], path, target[1], draws.number())


def wire(
    draws: Draws, sources: Iterable[B], targets: Iterable[B], probability: float
) -> None:
    """Add connections between neurons of branches, each possible with a probability."""
    ends = endpoints(targets, "output", "hidden")
    for source in endpoints(sources, "input", "output", "hidden"):
        source[0].connections += tuple(
            connect(draws, source, target)
            for target in ends
            if draws.chance(probability)
        )


def delete_hidden_neurons(
    draws: Draws, branches: Sequence[Branch], probability: float
) -> None:
    """Delete each hidden neuron with a probability, and its connections.

    Connections of the remaining neurons keep their source and target.
    """
    number, new_offsets = draws.number, dict[Branch, list[int | None]]()
    for branch in [one for one in branches if one.hidden]:
        stays = [number() >= probability for _ in branch.hidden]
        if not all(stays):
            offsets = iter(range(len(stays)))
            new_offsets[branch] = [next(offsets) if stay else None for stay in stays]
    if not new_offsets:
        return
    for branch in branches:
        genes = [_renumbered(gene, branch, new_offsets) for gene in branch.connections]
        branch.connections = tuple(filter(None, genes))
    for branch, after_deletion in new_offsets.items():
        branch.hidden = tuple(
            neuron
            for neuron, after in zip(branch.hidden, after_deletion, strict=True)
            if after is not None
        )


def _renumbered(
    gene: ConnectionGene, owner: Branch, new_offsets: dict[Branch, list[int | None]]
) -> ConnectionGene | None:
    """Return a connection with new offsets; None if one of its neurons is deleted."""
    if "hidden" not in (gene.source[0], gene.target[0]):
        return gene
    end = owner.along(gene.path)
    source = _moved(gene.source, new_offsets.get(owner))
    target = _moved(gene.target, new_offsets.get(end) if end else None)
    return replace(gene, source=source, target=target) if source and target else None


def _moved(
    neuron: tuple[Layer, int], offsets: list[int | None] | None
) -> tuple[Layer, int] | None:
    """Return the layer and new offset of a neuron; None if it is deleted."""
    layer, before = neuron
    if offsets is None or layer != "hidden":
        return neuron
    if before >= len(offsets):
        # An offset beyond the layer stays beyond it.
        return layer, before - offsets.count(None)
    after = offsets[before]
    return None if after is None else (layer, after)


def delete_connections(
    draws: Draws, branches: Sequence[Branch], probability: float
) -> None:
    """Delete each connection with a probability."""
    for branch in branches:
        branch.connections = tuple(
            gene for gene in branch.connections if draws.number() >= probability
        )


def vary_neurons(
    draws: Draws, branches: Sequence[Branch], epsilon: float, kinds: NeuronKinds
) -> None:
    """Move the parameters of every neuron towards random values."""
    for branch in branches:
        branch.outputs = _varied(draws, branch.outputs, epsilon, kinds)
        branch.hidden = _varied(draws, branch.hidden, epsilon, kinds)


def _varied(
    draws: Draws, neurons: tuple[NeuronGene, ...], epsilon: float, kinds: NeuronKinds
) -> tuple[NeuronGene, ...]:
    return tuple(
        NeuronGene(kind, draws.nearby(kinds[kind], values, epsilon))
        for kind, values in map(astuple, neurons)
    )


def add_hidden_neurons(
    draws: Draws,
    branches: Sequence[Branch],
    before: int,
    rules: BrainRules,
    kinds: NeuronKinds,
) -> None:
    """Add as many hidden neurons as deletion removes, on average, of those before."""
    wanted = draws.rounded(before * rules.p_delete_hidden_neuron)
    if not wanted:
        return
    types = tuple(kinds.items())
    room = rules.max_hidden - sum(len(b.hidden) for b in branches)
    for _ in range(min(wanted, room)):
        draws.pick(branches).hidden += (random_neuron(draws, types),)


def add_connections(
    draws: Draws, branches: Sequence[Branch], before: int, rules: BrainRules
) -> None:
    """Add as many connections as deletion removes, on average, of those before.

    The number is rounded half up; the probability counts as the decimal number of the
    document, so that halves are exact.
    """
    probability = Decimal(repr(rules.p_remove_brain_connection))
    count = int(before * probability + _HALF)
    if not count:
        return
    sources = endpoints(branches, "input", "output", "hidden")
    targets = [endpoint for endpoint in sources if endpoint[1][0] != "input"]
    if not (sources and targets):
        return
    for _ in range(count):
        source, target = draws.pick(sources), draws.pick(targets)
        source[0].connections += (connect(draws, source, target),)
