"""Mutation of a network, step by step; `network` calls the steps in order.

Each step changes a tree in place and keeps every restriction. Source: Hupkes 2016,
section 4.4.6; the code of the original. One of its errors is avoided: deleting a hidden
neuron redirects no other connection.
"""

from collections.abc import Sequence
from decimal import Decimal

from msgspec.structs import replace

from coordinator.evolution.brain_generation import connect, endpoints, random_neuron
from schema.plugins.protocols import BrainRules, Branch, Draws
from schema.robot.brain import Layer, NeuronKinds
from schema.robot.genome import ConnectionGene, NeuronGene

_HALF = Decimal("0.5")


def delete_hidden_neurons(
    draws: Draws, branches: Sequence[Branch], probability: float
) -> None:
    """Delete each hidden neuron with a probability, and its connections.

    Connections of the remaining neurons keep their source and target.
    """
    new_offsets: dict[Branch, list[int | None]] = {}
    for branch in [one for one in branches if one.hidden]:
        stays = [not draws.chance(probability) for _ in branch.hidden]
        if not all(stays):
            offsets = iter(range(len(stays)))
            new_offsets[branch] = [next(offsets) if stay else None for stay in stays]
    if not new_offsets:
        return
    for branch in branches:
        if branch.connections:
            genes = [
                _renumbered(gene, branch, new_offsets) for gene in branch.connections
            ]
            branch.connections = tuple(filter(None, genes))
    for branch, after_deletion in new_offsets.items():
        branch.hidden = tuple(
            neuron
            for neuron, after in zip(branch.hidden, after_deletion, strict=True)
            if after is not None
        )


def _renumbered(
    gene: ConnectionGene,
    owner: Branch,
    new_offsets: dict[Branch, list[int | None]],
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
        if branch.connections:
            branch.connections = tuple(
                [gene for gene in branch.connections if draws.number() >= probability]
            )


def vary_neurons(
    draws: Draws, branches: Sequence[Branch], epsilon: float, kinds: NeuronKinds
) -> None:
    """Move the parameters of every neuron towards random values."""
    for branch in branches:
        # Most parts have no neurons.
        if branch.outputs:
            branch.outputs = _varied(draws, branch.outputs, epsilon, kinds)
        if branch.hidden:
            branch.hidden = _varied(draws, branch.hidden, epsilon, kinds)


def _varied(
    draws: Draws,
    neurons: tuple[NeuronGene, ...],
    epsilon: float,
    kinds: NeuronKinds,
) -> tuple[NeuronGene, ...]:
    return tuple(
        [
            NeuronGene(
                neuron.kind,
                draws.nearby(kinds[neuron.kind], neuron.parameters, epsilon),
            )
            for neuron in neurons
        ]
    )


def add_hidden_neurons(
    draws: Draws,
    branches: Sequence[Branch],
    before: int,
    rules: BrainRules,
    kinds: NeuronKinds,
) -> None:
    """Add as many hidden neurons as deletion removes on average.

    Args:
        draws: source of all choices.
        branches: branches of the tree, depth first.
        before: number of hidden neurons before deletion.
        rules: probability of deletion, limit and rounding.
        kinds: neuron types.
    """
    if rules.hidden_rounding == "half-up":
        wanted = _share(before, rules.p_delete_hidden_neuron)
    else:
        wanted = draws.rounded(before * rules.p_delete_hidden_neuron)
    types = tuple(kinds.items())
    room = rules.max_hidden - sum(len(b.hidden) for b in branches)
    for _ in range(min(wanted, room)):
        draws.pick(branches).hidden += (random_neuron(draws, types),)


def add_connections(
    draws: Draws,
    branches: Sequence[Branch],
    before: int,
    rules: BrainRules,
) -> None:
    """Add as many connections as deletion removes on average, rounded half up.

    Args:
        draws: source of all choices.
        branches: branches of the tree, depth first.
        before: number of connections before deletion.
        rules: probability of deletion.
    """
    count = _share(before, rules.p_remove_brain_connection)
    if not count:
        return
    sources = endpoints(branches, "input", "output", "hidden")
    targets = [endpoint for endpoint in sources if endpoint[1][0] != "input"]
    if not (sources and targets):
        return
    for _ in range(count):
        source, target = draws.pick(sources), draws.pick(targets)
        source[0].connections += (connect(draws, source, target),)


def _share(count: int, probability: float) -> int:
    """Return a share of a count, rounded half up.

    The probability counts as the decimal number of the document: halves are exact.
    """
    return int(count * Decimal(repr(probability)) + _HALF)
