"""The steps of mutation that change a network, one by one."""

from collections import Counter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from coordinator.evolution.brains import brain_rules
from coordinator.evolution.mutable_genome import to_branches, to_genome
from coordinator.evolution.network import (
    add_connections,
    add_hidden_neurons,
    delete_connections,
    delete_hidden_neurons,
    vary_neurons,
)
from coordinator.evolution.random_streams import BufferedRng
from schema.robot.brain import NEURON_TYPES, Layer
from schema.robot.genome import ConnectionGene, Genome, NeuronGene, develop, walk
from tests.coordinator.genomes import TYPES, draws, experiment, founder, node

N = 2000


def neuron(bias: float) -> NeuronGene:
    return NeuronGene("Simple", (bias, 0.5))


def scripted(*numbers: float) -> BufferedRng:
    made = draws()
    made.number = iter(numbers).__next__
    return made


def edge(
    source: tuple[Layer, int], path: tuple[int, ...], target: tuple[Layer, int]
) -> ConnectionGene:
    return ConnectionGene(source, path, target, 0.25)


HINGE = node(
    "ActiveHinge",
    hidden=(neuron(0.1), neuron(0.2), neuron(0.3)),
    connections=(
        edge(("hidden", 0), (), ("output", 0)),
        edge(("hidden", 1), (), ("hidden", 2)),
        edge(("hidden", 2), (), ("hidden", 0)),
        edge(("hidden", 2), (), ("hidden", 7)),
        edge(("hidden", 5), (), ("output", 0)),
    ),
)
CORE = node(
    "Core",
    (2, HINGE),
    connections=(
        edge(("input", 0), (2,), ("hidden", 0)),
        edge(("input", 1), (2,), ("hidden", 1)),
        edge(("input", 2), (2,), ("hidden", 2)),
        edge(("input", 3), (3,), ("hidden", 2)),
        edge(("input", 4), (2,), ("output", 0)),
    ),
)


def test_deleting_a_hidden_neuron_drops_its_connections_and_shifts_the_rest() -> None:
    core, hinge = to_branches(CORE, TYPES)
    # Three hidden neurons are asked in turn; only the second goes.
    delete_hidden_neurons(scripted(0.9, 0.01, 0.9), [core, hinge], 0.05)
    assert hinge.hidden == (neuron(0.1), neuron(0.3))
    assert hinge.connections == (
        edge(("hidden", 0), (), ("output", 0)),
        edge(("hidden", 1), (), ("hidden", 0)),
        edge(("hidden", 1), (), ("hidden", 6)),
        edge(("hidden", 4), (), ("output", 0)),
    )
    assert core.connections == (
        edge(("input", 0), (2,), ("hidden", 0)),
        edge(("input", 2), (2,), ("hidden", 1)),
        edge(("input", 3), (3,), ("hidden", 2)),
        edge(("input", 4), (2,), ("output", 0)),
    )


def wiring(genome: Genome) -> Counter[tuple[object, ...]]:
    """Return a robot's connections by the neurons' own parameters."""
    brain = develop(genome, TYPES).brain
    names = [(n.layer, n.kind, n.part, n.parameters) for n in brain.neurons]
    return Counter(
        (names[e.source], names[e.target], e.weight) for e in brain.connections
    )


@given(st.integers(0, 2**32 - 1), st.floats(0.05, 0.9))
def test_deleting_hidden_neurons_keeps_other_connections(
    seed: int, probability: float
) -> None:
    """Oracle on the robot: drop the edges of the removed neurons, and no others."""
    genome = founder(seed)
    branches = to_branches(genome, TYPES)
    delete_hidden_neurons(draws(seed), branches, probability)
    after = to_genome(branches)
    left = {n.parameters for one, _, _ in walk(after) for n in one.hidden}
    expected = Counter(
        {
            key: count
            for key, count in wiring(genome).items()
            if all(end[0] != "hidden" or end[3] in left for end in key[:2])  # type: ignore[index]
        }
    )
    assert wiring(after) == expected


@pytest.mark.parametrize("probability", [0.0, 0.05, 0.5, 1.0])
def test_neurons_and_connections_are_deleted_with_their_probabilities(
    probability: float,
) -> None:
    neurons = edges = 0
    for seed in range(N):
        branches = to_branches(CORE, TYPES)
        delete_hidden_neurons(draws(seed), branches, probability)
        neurons += 3 - len(branches[1].hidden)
        branches = to_branches(CORE, TYPES)
        delete_connections(draws(seed), branches, probability)
        edges += 10 - sum(len(branch.connections) for branch in branches)
    spread = 5 * (probability * (1 - probability)) ** 0.5
    assert abs(neurons / N / 3 - probability) <= spread / (3 * N) ** 0.5
    assert abs(edges / N / 10 - probability) <= spread / (10 * N) ** 0.5


def test_neuron_parameters_move_by_their_share_and_types_stay() -> None:
    moved = []
    for seed in range(N):
        core, hinge = to_branches(CORE, TYPES)
        vary_neurons(draws(seed), [core, hinge], 0.1, NEURON_TYPES)
        moved.append(hinge.outputs[0].parameters)
        assert hinge.connections == HINGE.connections, "weights never mutate"
        assert {one.kind for one in hinge.hidden} == {"Simple"}
    biases, gains = np.array(moved).T
    # 0.9 x 0 + 0.1 x U(-1, 1), and 0.9 x 0.5 + 0.1 x U(0, 1).
    assert -0.1 <= biases.min() < -0.0995
    assert 0.0995 < biases.max() <= 0.1
    assert 0.45 <= gains.min() < 0.4505
    assert 0.5495 < gains.max() <= 0.55


@pytest.mark.parametrize(("before", "expected"), [(3, 0.15), (7, 0.35), (20, 1.0)])
def test_how_many_hidden_neurons_are_added(before: int, expected: float) -> None:
    rules = brain_rules(experiment())
    found = []
    kinds: Counter[str] = Counter()
    for seed in range(N):
        core, hinge = to_branches(CORE, TYPES)
        add_hidden_neurons(draws(seed), [core, hinge], before, rules, NEURON_TYPES)
        found.append(len(core.hidden) + len(hinge.hidden) - 3)
        kinds.update(one.kind for one in (*core.hidden, *hinge.hidden[3:]))
        assert hinge.hidden[:3] == HINGE.hidden, "new ones come last"
    assert np.mean(found) == pytest.approx(expected, abs=2.5 / N**0.5)
    if expected == 1.0:
        assert set(found) == {1}
        assert sorted(kinds) == sorted(NEURON_TYPES)


def test_hidden_neurons_are_added_up_to_the_limit() -> None:
    rules = brain_rules(experiment({"max_hidden": 5}, p_delete_hidden_neuron=1.0))
    branches = to_branches(CORE, TYPES)
    add_hidden_neurons(draws(), branches, 9, rules, NEURON_TYPES)
    assert sum(len(branch.hidden) for branch in branches) == 5


@pytest.mark.parametrize(
    ("before", "count"), [(0, 0), (9, 0), (10, 1), (29, 1), (30, 2), (50, 3)]
)
def test_how_many_connections_are_added(before: int, count: int) -> None:
    branches = to_branches(CORE, TYPES)
    add_connections(draws(), branches, before, brain_rules(experiment()))
    assert sum(len(branch.connections) for branch in branches) == 10 + count


def test_added_connections_join_any_neuron_with_any_output_or_hidden() -> None:
    bare = node("Core", (2, node("ActiveHinge", hidden=(neuron(0.1),))))
    found: Counter[tuple[int, int]] = Counter()
    for seed in range(N):
        branches = to_branches(bare, TYPES)
        add_connections(draws(seed), branches, 10, brain_rules(experiment()))
        (made,) = develop(to_genome(branches), TYPES).brain.connections
        found[made.source, made.target] += 1
        assert 0.0 <= made.weight < 1.0
    # Inputs 0..5, output 6, hidden 7: eight sources, two targets.
    assert sorted(found) == [(s, t) for s in range(8) for t in (6, 7)]
    assert all(abs(n - N / 16) < 5 * (N / 16) ** 0.5 for n in found.values())


def test_no_connection_is_added_without_a_target() -> None:
    lone = node("Core", (0, node("Hinge")))
    branches = to_branches(lone, TYPES)
    add_connections(draws(), branches, 40, brain_rules(experiment()))
    assert to_genome(branches) == lone
