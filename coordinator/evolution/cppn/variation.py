"""Random networks, mutation, and crossover aligned by historical markings.

A new node is named by a digest of the connection that it splits. The same innovation
therefore has the same marking in every network, without a common counter.
Source: Stanley and Miikkulainen, 2002, NEAT.
"""

from collections.abc import Sequence
from hashlib import blake2b
from typing import Annotated, TypeVar

import numpy as np
from msgspec import Meta, Struct
from msgspec.structs import replace

from coordinator.evolution.cppn.network import (
    FUNCTIONS,
    GREATEST_WEIGHT,
    INPUTS,
    CppnGenome,
    HiddenNode,
    Link,
    reaches,
)
from schema.experiment.section import Probability

T = TypeVar("T")

_NEW_WEIGHT = 0.1
"""Share of changed weights that become new random ones."""


class Parameters(Struct, frozen=True):
    """Parameters of the encoding ``cppn``.

    Attributes:
        p_connect: probability of each connection of an input to an output in random
            networks.
        first_nodes: hidden nodes of random networks.
        p_weight: probability that mutation changes the weight of a connection.
        weight_step: greatest change of a weight.
        p_toggle: probability that mutation enables or disables a connection.
        p_function: probability that mutation changes the function of a node.
        p_add_connection: probability that mutation adds a connection.
        p_add_node: probability that mutation adds a hidden node.
        max_nodes: greatest number of hidden nodes.
        max_connections: greatest number of connections.
    """

    p_connect: Probability = 0.2
    first_nodes: Annotated[int, Meta(ge=0, le=100)] = 5
    p_weight: Probability = 0.3
    weight_step: Annotated[float, Meta(ge=0, le=2 * GREATEST_WEIGHT)] = 0.5
    p_toggle: Probability = 0.01
    p_function: Probability = 0.05
    p_add_connection: Probability = 0.3
    p_add_node: Probability = 0.15
    max_nodes: Annotated[int, Meta(ge=0, le=100)] = 40
    max_connections: Annotated[int, Meta(ge=0, le=1000)] = 300


def random_network(
    rng: np.random.Generator, outputs: Sequence[str], rules: Parameters
) -> CppnGenome:
    """Return a random network."""
    links = [
        Link(source, target, _weight(rng))
        for source in INPUTS
        for target in outputs
        if rng.random() < rules.p_connect
    ]
    links = sorted(links, key=_marking)[: rules.max_connections]
    network = CppnGenome((), tuple(links))
    for _ in range(rules.first_nodes):
        network = add_node(network, rng, rules)
        network = add_link(network, rng, outputs, rules)
    return network


def mutate(
    network: CppnGenome,
    rng: np.random.Generator,
    outputs: Sequence[str],
    rules: Parameters,
) -> CppnGenome:
    """Return a network with changed weights, functions and structure."""
    links = []
    for old in network.links:
        weight, is_enabled = old.weight, old.is_enabled
        if rng.random() < rules.p_weight:
            step = rules.weight_step * (2.0 * rng.random() - 1.0)
            is_new = rng.random() < _NEW_WEIGHT
            weight = _weight(rng) if is_new else _limited(weight + step)
        if rng.random() < rules.p_toggle:
            is_enabled = not is_enabled
        links.append(Link(*old.marking, weight, is_enabled))
    nodes = [
        replace(node, function=_pick(rng, list(FUNCTIONS)))
        if rng.random() < rules.p_function
        else node
        for node in network.nodes
    ]
    network = CppnGenome(tuple(nodes), tuple(links))
    if rng.random() < rules.p_add_node:
        network = add_node(network, rng, rules)
    if rng.random() < rules.p_add_connection:
        network = add_link(network, rng, outputs, rules)
    return network


def add_node(
    network: CppnGenome, rng: np.random.Generator, rules: Parameters
) -> CppnGenome:
    """Return a network in which a new node splits an enabled connection.

    The old connection is disabled; the new ones have weight 1 and its weight. A network
    at its limits stays as it is.
    """
    enabled = [link for link in network.links if link.is_enabled]
    has_room = len(network.links) + 2 <= rules.max_connections
    if not enabled or not has_room or len(network.nodes) >= rules.max_nodes:
        return network
    split = _pick(rng, enabled)
    node = HiddenNode(
        new_id(split, {each.id for each in network.nodes}), _pick(rng, list(FUNCTIONS))
    )
    links = [
        replace(link, is_enabled=False) if link is split else link
        for link in network.links
    ]
    into, out_of = (split.source, node.id), (node.id, split.target)
    links += [Link(*into, 1.0), Link(*out_of, split.weight)]
    return _sorted([*network.nodes, node], links)


def add_link(
    network: CppnGenome,
    rng: np.random.Generator,
    outputs: Sequence[str],
    rules: Parameters,
) -> CppnGenome:
    """Return a network with a new connection that closes no cycle.

    The pair of nodes is uniform; a pair that is connected, or would close a cycle,
    leaves the network as it is, as do its limits.
    """
    ids = [node.id for node in network.nodes]
    source, target = _pick(rng, [*INPUTS, *ids]), _pick(rng, [*ids, *outputs])
    link = Link(source, target, _weight(rng))
    if (
        len(network.links) >= rules.max_connections
        or any(each.marking == link.marking for each in network.links)
        or reaches(network.links, target, source)
    ):
        return network
    return _sorted(network.nodes, [*network.links, link])


def crossover(
    first: CppnGenome, second: CppnGenome, rng: np.random.Generator
) -> CppnGenome:
    """Return the first network with half of the genes that both have from the second.

    Genes with equal markings are the same innovation. Nodes and connections of the
    first alone stay, those of the second alone are left out, as NEAT does with those of
    the less fit parent; so the child has no cycles and keeps all limits.
    """
    nodes = {node.id: node for node in second.nodes}
    links = {link.marking: link for link in second.links}
    return CppnGenome(
        tuple(_either(rng, node, nodes.get(node.id)) for node in first.nodes),
        tuple(_either(rng, link, links.get(link.marking)) for link in first.links),
    )


def new_id(split: Link, taken: set[str]) -> str:
    """Return the marking, not taken yet, of the node that splits a connection.

    The network may have split this connection before.
    """
    count = 0
    while True:
        text = f"{split.source} {split.target} {count}"
        name = f"#{blake2b(text.encode(), digest_size=8).hexdigest()}"
        if name not in taken:
            return name
        count += 1


def _either(rng: np.random.Generator, ours: T, theirs: T | None) -> T:
    return ours if theirs is None or rng.random() < 0.5 else theirs  # noqa: PLR2004


def _sorted(nodes: Sequence[HiddenNode], links: Sequence[Link]) -> CppnGenome:
    ordered = sorted(nodes, key=lambda node: node.id)
    return CppnGenome(tuple(ordered), tuple(sorted(links, key=_marking)))


def _marking(link: Link) -> tuple[str, str]:
    return link.marking


def _pick(rng: np.random.Generator, items: Sequence[T]) -> T:
    return items[int(rng.random() * len(items))]


def _weight(rng: np.random.Generator) -> float:
    return GREATEST_WEIGHT * (2.0 * rng.random() - 1.0)


def _limited(weight: float) -> float:
    return min(max(weight, -GREATEST_WEIGHT), GREATEST_WEIGHT)
