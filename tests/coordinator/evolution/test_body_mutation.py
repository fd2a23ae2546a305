"""The steps of mutation that change the body, one by one."""

import math
from collections import Counter
from operator import le
from typing import Any

import numpy as np
import pytest

from coordinator.evolution.generation import generate
from coordinator.evolution.mutable_genome import (
    gene_ids,
    preorder,
    size_limits,
    size_of,
    to_branches,
    to_genome,
    to_mutable,
)
from coordinator.evolution.revolve_angle import (
    add_parts,
    delete_subtree,
    duplicate_subtree,
    expected_parts,
    swap_subtrees,
    vary_parts,
)
from schema.experiment.document import Experiment, Generation
from schema.robot.genome import Genome, walk
from schema.robot.ids import BirthId
from tests.coordinator.genomes import TYPES, draws, experiment, node

N = 2000


def shape(genome: Genome) -> str:
    """Return a genome as text: initial of the kind, then slot and child."""
    inner = "".join(f" {slot}{shape(child)}" for slot, child in genome.children)
    return genome.kind[0] + (f"({inner[1:]})" if inner else "")


def is_near(found: int, expected: float) -> bool:
    return abs(found - expected) < 5 * math.sqrt(max(expected, 1.0))


def after(
    step: Any,  # noqa: ANN401 - a step of mutation
    seed: int,
    setting: Experiment,
    genome: Genome,
) -> Genome:
    """Return what a step makes of a genome."""
    root = to_mutable(genome, TYPES)
    step(draws(seed), root, setting)
    return to_genome(preorder(root))


def shapes(step: Any, setting: Experiment, genome: Genome) -> Counter[str]:  # noqa: ANN401
    """Return how often a step makes which shape."""
    return Counter(shape(after(step, seed, setting, genome)) for seed in range(N))


CHAIN = node(
    "Core",
    (1, node("FixedBrick", (1, node("Hinge", (1, node("ActiveHinge")))))),
    (2, node("TouchSensor")),
)


def test_deletion_keeps_the_least_number_of_parts() -> None:
    setting = experiment({"min_parts": 3}, p_delete_subtree=1.0)
    found = shapes(delete_subtree, setting, CHAIN)
    # Without the brick's subtree only two parts would be left.
    assert sorted(found) == ["C(1F 2T)", "C(1F(1H(1A)))", "C(1F(1H) 2T)"]
    assert all(is_near(n, N / 3) for n in found.values())
    full = experiment({"min_parts": 5}, p_delete_subtree=1.0)
    assert after(delete_subtree, 0, full, CHAIN) == CHAIN


def test_duplicating_puts_a_copy_on_any_free_slot() -> None:
    small = node("Core", (1, node("Hinge", slot=1)), (2, node("TouchSensor")))
    found = shapes(duplicate_subtree, experiment(p_duplicate_subtree=1.0), small)
    assert sorted(found) == sorted(
        [
            *("C(0H 1H 2T)", "C(1H 2T 3H)", "C(1H(0H) 2T)"),
            *("C(0T 1H 2T)", "C(1H 2T 3T)", "C(1H(0T) 2T)"),
        ]
    )
    assert all(is_near(n, N / 6) for n in found.values())


def test_duplicating_keeps_within_every_limit() -> None:
    for limit in ({"max_parts": 6}, {"max_inputs": 9}, {"max_outputs": 1}):
        setting = experiment(limit, p_duplicate_subtree=1.0)
        for seed in range(200):
            copied = after(duplicate_subtree, seed, setting, CHAIN)
            size = size_of(to_branches(copied, TYPES))
            assert all(map(le, size, size_limits(setting.space)))
    full = experiment({"max_parts": 5}, p_duplicate_subtree=1.0)
    assert after(duplicate_subtree, 0, full, CHAIN) == CHAIN


def test_swapping_exchanges_places_and_keeps_own_slots() -> None:
    setting = experiment(p_swap_subtree=1.0)
    found: Counter[str] = Counter()
    for seed in range(N):
        swapped = after(swap_subtrees, seed, setting, CHAIN)
        found[shape(swapped)] += 1
        assert sorted(
            str(one.slot) + one.kind for one, _, _ in walk(swapped)
        ) == sorted(str(one.slot) + one.kind for one, _, _ in walk(CHAIN))
    # The sensor may change places with each part of the other arm; whichever of
    # the arm is drawn first has the sensor alone to change with.
    assert sorted(found) == ["C(1F(1H(1T)) 2A)", "C(1F(1T) 2H(1A))", "C(1T 2F(1H(1A)))"]
    assert all(is_near(n, N / 3) for n in found.values())


def test_swapping_skips_a_tree_of_one_line() -> None:
    line = node("Core", (0, node("Hinge", (1, node("Hinge")))))
    setting = experiment(p_swap_subtree=1.0)
    assert all(after(swap_subtrees, seed, setting, line) == line for seed in range(20))


@pytest.mark.parametrize(
    ("step", "key"),
    [
        (delete_subtree, "p_delete_subtree"),
        (duplicate_subtree, "p_duplicate_subtree"),
        (swap_subtrees, "p_swap_subtree"),
    ],
)
@pytest.mark.parametrize("probability", [0.0, 0.05, 0.4])
def test_each_step_happens_with_its_probability(
    step: Any,  # noqa: ANN401 - one of three functions
    key: str,
    probability: float,
) -> None:
    chances: dict[str, Any] = {key: probability}
    setting = experiment(**chances)
    happened = [after(step, seed, setting, CHAIN) != CHAIN for seed in range(N)]
    assert is_near(sum(happened), N * probability)


def test_parameters_of_parts_move_and_colours_stay() -> None:
    bar = node("Core", (0, node("ParametricBarJoint")), (1, node("ActiveHinge")))
    lengths = []
    for seed in range(N):
        root = to_mutable(bar, TYPES)
        vary_parts(draws(seed), preorder(root), 0.05)
        core, part, hinge = preorder(root)
        length, alpha, beta, *colour = part.parameters
        lengths.append(length)
        assert abs(alpha) <= 0.05 * np.pi / 2
        assert (beta, colour) == (0.0, [0.5, 0.5, 0.5])
        assert core.parameters == hinge.parameters == (0.5, 0.5, 0.5)
    # 0.95 of 50, and 0.05 of U(20, 100).
    assert 48.5 <= min(lengths) < 48.6
    assert 52.4 < max(lengths) <= 52.5


def test_expected_parts_by_hand() -> None:
    # Subtrees: brick 3, hinge 2, motor 1, sensor 1; five parts.
    # Deletable at least 3 parts: 2, 1, 1, mean 4/3. Duplicable at most 7 parts
    # and 10 inputs: all but the brick's, as the sensor's inputs fit once more.
    setting: dict[str, Any] = {"p_delete_subtree": 0.6, "p_duplicate_subtree": 0.3}
    root = to_mutable(CHAIN, TYPES)
    tight = {"max_parts": 7}
    mean = expected_parts(preorder(root), experiment(tight, **setting))
    assert mean == pytest.approx(0.6 * 4 / 3 - 0.3 * 4 / 3)
    room = {"max_parts": 6, "min_parts": 2}
    greedy = experiment(room, p_delete_subtree=1.0, p_duplicate_subtree=0.0)
    assert expected_parts(preorder(root), greedy) == 1.0, (
        "one part more is all there is room for"
    )
    shut = experiment({"max_parts": 5}, **setting)
    assert expected_parts(preorder(root), shut) == 0.0


def added(seed: int, setting: Experiment, genome: Genome = CHAIN) -> Genome:
    root = to_mutable(genome, TYPES)
    add_parts(draws(seed), preorder(root), gene_ids(BirthId(0, 7)), setting)
    return to_genome(preorder(root))


def test_a_new_part_has_its_own_identity_colour_and_outgoing_connections() -> None:
    # An expectation of 0.44 is one trial: at most one new part.
    setting = experiment(
        {"min_parts": 1}, p_delete_subtree=0.25, p_duplicate_subtree=0.0
    )
    setting = Experiment(
        name="test",
        space=setting.space,
        variation=setting.variation,
        generation=Generation(p_connect_neurons=1.0),
    )
    seen: Counter[str] = Counter()
    for seed in range(600):
        genome = added(seed, setting)
        old = [one for one, _, _ in walk(genome) if not one.gene]
        new = [one for one, _, _ in walk(genome) if one.gene]
        assert all(not one.connections for one in old), "only from the new part"
        for part in new:
            seen[part.kind] += 1
            assert part.gene == 7 << 16 | 1
            assert part.parameters[-3:] != (0.5, 0.5, 0.5)
            # 0..10 hidden neurons over five parts, rounded half up: 0, 1 or 2.
            assert len(part.hidden) <= 2
            own = len(part.outputs) + len(part.hidden)
            sources = own + TYPES[part.kind].inputs
            # The full product with the one motor of the chain and its own.
            assert len(part.connections) == sources * (1 + own)
            assert all(0.0 <= edge.weight <= 1.0 for edge in part.connections)
    assert sorted(seen) == sorted(set(TYPES) - {"Core"})


def test_with_the_thesis_s_numbers_parts_are_rarely_added() -> None:
    """The expectation is positive in 1.8 % of random robots without hidden neurons.

    A subtree with hidden neurons often does not fit a second time, so smaller subtrees
    are duplicated: the expectation is then positive in 9 %.
    """
    for max_hidden, figure in {0: 0.018, 10: 0.09}.items():
        setting = experiment({"max_hidden": max_hidden})
        positive = [
            expected_parts(
                to_branches(generate(np.random.default_rng(seed), setting), TYPES),
                setting,
            )
            > 0.0
            for seed in range(2000)
        ]
        assert np.mean(positive) == pytest.approx(
            figure, abs=3 * (figure / 2000) ** 0.5
        )
