"""Random networks, mutation, and crossover by markings."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from coordinator.evolution.cppn.network import (
    GREATEST_WEIGHT,
    CppnGenome,
    HiddenNode,
    Link,
    from_bytes,
    to_bytes,
)
from coordinator.evolution.cppn.variation import (
    Parameters,
    add_link,
    add_node,
    crossover,
    mutate,
    new_id,
    random_network,
)

OUTPUTS = ("a", "b", "c")
RULES = Parameters()


def rng(seed: int = 1) -> np.random.Generator:
    return np.random.default_rng(seed)


def test_a_new_node_splits_a_connection() -> None:
    link = Link("x1", "a", -0.75)
    network = add_node(CppnGenome((), (link,)), rng(), RULES)
    (node,) = network.nodes
    assert node.id == new_id(link, set())
    assert sorted(network.links, key=lambda link: link.marking) == [*network.links]
    assert {(each.marking, each.weight, each.is_enabled) for each in network.links} == {
        (("x1", "a"), -0.75, False),
        (("x1", node.id), 1.0, True),
        ((node.id, "a"), -0.75, True),
    }


def test_the_same_innovation_has_the_same_marking_in_all_networks() -> None:
    common = Link("x1", "a", 0.5)
    others = (
        CppnGenome((), (common,)),
        CppnGenome((HiddenNode("#0", "bell"),), (common,)),
    )
    ids = [
        {node.id for node in add_node(each, rng(seed), RULES).nodes} - {"#0"}
        for seed, each in enumerate(others)
    ]
    assert ids[0] == ids[1]


def test_a_connection_can_be_split_again() -> None:
    link = Link("x1", "a", 0.5)
    first = new_id(link, set())
    second = new_id(link, {first})
    assert len({first, second, new_id(Link("x1", "b", 0.5), set())}) == 3
    assert new_id(link, {"#0"}) == first


def test_limits_stop_growth() -> None:
    network = CppnGenome((), (Link("x1", "a", 0.5),))
    for rules in Parameters(max_nodes=0), Parameters(max_connections=2):
        assert add_node(network, rng(), rules) == network
    full = Parameters(max_connections=1)
    assert all(add_link(network, rng(k), OUTPUTS, full) == network for k in range(50))


def test_a_new_connection_closes_no_cycle() -> None:
    nodes = HiddenNode("#1", "bell"), HiddenNode("#2", "bell")
    network = CppnGenome(nodes, (Link("#1", "#2", 1.0),))
    found = [add_link(network, rng(seed), OUTPUTS, RULES) for seed in range(400)]
    markings = {link.marking for each in found for link in each.links}
    assert {("x1", "#1"), ("bias", "a"), ("#2", "c")} <= markings
    assert not {("#2", "#1"), ("#1", "#1"), ("#2", "#2")} & markings


def test_mutation_without_probabilities_changes_nothing() -> None:
    network = random_network(rng(), OUTPUTS, RULES)
    still = Parameters(
        p_weight=0, p_toggle=0, p_function=0, p_add_connection=0, p_add_node=0
    )
    assert mutate(network, rng(2), OUTPUTS, still) == network


def test_mutation_of_weights_keeps_structure_and_steps() -> None:
    network = random_network(rng(), OUTPUTS, Parameters(p_connect=1.0, first_nodes=0))
    rules = Parameters(
        p_weight=1, weight_step=0.1, p_toggle=0, p_function=0,
        p_add_connection=0, p_add_node=0,
    )  # fmt: skip
    changed = mutate(network, rng(2), OUTPUTS, rules)
    steps = [
        abs(new.weight - old.weight)
        for old, new in zip(network.links, changed.links, strict=True)
    ]
    assert [each.marking for each in changed.links] == [
        each.marking for each in network.links
    ]
    # A tenth of the changed weights is new.
    assert 0.7 < np.mean([step <= 0.1 for step in steps]) < 1.0


def test_crossover_takes_matching_genes_of_both_and_other_genes_of_the_first() -> None:
    first = CppnGenome(
        (HiddenNode("#1", "bell"), HiddenNode("#2", "wave")),
        (Link("#1", "a", 1.0), Link("#2", "a", 1.0), Link("x1", "#1", 1.0)),
    )
    second = CppnGenome(
        (HiddenNode("#1", "line"), HiddenNode("#3", "line")),
        (Link("#1", "a", 2.0, is_enabled=False), Link("#3", "a", 2.0),
         Link("x1", "#1", 2.0)),
    )  # fmt: skip
    children = [crossover(first, second, rng(seed)) for seed in range(60)]
    for child in children:
        assert [node.id for node in child.nodes] == ["#1", "#2"]
        assert [each.marking for each in child.links] == [
            each.marking for each in first.links
        ]
        assert child.nodes[1] == first.nodes[1]
        assert child.links[1] == first.links[1]
    kinds = {
        (each.nodes[0].function, each.links[0], each.links[2]) for each in children
    }
    assert kinds == {
        (function, ours, theirs)
        for function in ("bell", "line")
        for ours in (first.links[0], second.links[0])
        for theirs in (first.links[2], second.links[2])
    }


@given(seed=st.integers(0, 2**32), generations=st.integers(0, 12))
def test_all_networks_keep_their_rules(seed: int, generations: int) -> None:
    rules = Parameters(
        p_add_node=0.8, p_add_connection=0.8, p_toggle=0.3, weight_step=2.0,
        max_nodes=8, max_connections=20,
    )  # fmt: skip
    draws = rng(seed)
    one, other = (random_network(draws, OUTPUTS, rules) for _ in range(2))
    for _ in range(generations):
        one, other = mutate(crossover(one, other, draws), draws, OUTPUTS, rules), one
        # Reading checks all rules of a network.
        assert from_bytes(to_bytes(one), OUTPUTS) == one
        assert len(one.nodes) <= 8
        assert len(one.links) <= 20
        assert all(abs(each.weight) <= GREATEST_WEIGHT for each in one.links)
