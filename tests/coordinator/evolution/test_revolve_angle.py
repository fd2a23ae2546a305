"""Crossover, the order of mutation, and one whole mating attempt."""

from collections import Counter
from operator import le
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from coordinator.evolution.mutable_genome import (
    preorder,
    size_limits,
    size_of,
    to_branches,
    to_genome,
    to_mutable,
)
from coordinator.evolution.revolve_angle import RevolveAngle, crossover, donor_of
from schema.experiment.document import Experiment, body_space
from schema.robot.frames import place_parts, shapes_of
from schema.robot.genome import Genome, develop
from schema.robot.ids import BirthId
from schema.robot.robot import check_robot
from tests.coordinator.genomes import TYPES, draws, experiment, founder, kinds, node

DEFAULT = Experiment(name="test")
CHILD = BirthId(0, 99)
SEEDS = st.integers(0, 2**32 - 1)
STILL: dict[str, Any] = {
    "p_delete_subtree": 0.0,
    "p_duplicate_subtree": 0.0,
    "p_swap_subtree": 0.0,
    "p_delete_hidden_neuron": 0.0,
    "p_remove_brain_connection": 0.0,
    "body_epsilon": 0.0,
    "brain_epsilon": 0.0,
}


def encoding(setting: Experiment = DEFAULT) -> RevolveAngle:
    return RevolveAngle(setting, body_space(setting.space), None)


def crossed(
    seed: int, first: Genome, second: Genome, setting: Experiment = DEFAULT
) -> Genome | None:
    branches = to_branches(first, TYPES)
    root = branches[0]
    done = crossover(draws(seed), branches, donor_of(second, TYPES), setting)
    if not done:
        assert to_genome(preorder(root)) == first, "a failure changes nothing"
        return None
    return to_genome(preorder(root))


MOTHER = node(
    "Core",
    (0, node("Hinge", (1, node("FixedBrick", slot=2, gene=12)), gene=11)),
    (3, node("Hinge", gene=13, slot=1)),
)
FATHER = node("Core", (2, node("ActiveHinge", (0, node("TouchSensor")), slot=1)))


def test_crossover_replaces_any_subtree_by_any_other_but_never_a_root() -> None:
    motor = FATHER.children[0][1]
    sensor = motor.children[0][1]
    hinge, other = MOTHER.children
    expected = []
    for gift in (motor, sensor):
        inner = node("Hinge", (1, gift), gene=11)
        expected += [
            node("Core", (0, gift), other),
            node("Core", (0, inner), other),
            node("Core", hinge, (3, gift)),
        ]
    found = Counter(
        expected.index(child)
        for seed in range(1500)
        if (child := crossed(seed, MOTHER, FATHER))
    )
    assert sorted(found) == list(range(6))
    assert all(abs(n - 250) < 5 * 250**0.5 for n in found.values())


def test_crossover_takes_only_subtrees_that_fit() -> None:
    # Core 6 inputs, two sensors of 2 each: a third one never fits beside them.
    full = node("Core", (0, node("TouchSensor")), (1, node("TouchSensor")))
    donor = node("Core", (0, node("TouchSensor")), (1, node("Hinge")))
    tight = experiment({"max_inputs": 8})
    for seed in range(40):
        child = crossed(seed, full, donor, tight)
        assert child is not None
        assert kinds(child).count("Hinge") == 1, "two sensors are too many"


def test_crossover_fails_where_nothing_fits() -> None:
    donor = node("Core", (0, node("TouchSensor")))
    tight = experiment({"max_inputs": 7})
    assert crossed(1, MOTHER, donor, tight) is None
    assert crossed(1, node("Core"), donor) is None
    assert crossed(1, MOTHER, node("Core")) is None


def test_crossover_fails_on_too_few_parts() -> None:
    setting = experiment({"min_parts": 5})
    sizes = Counter(
        None if child is None else len(kinds(child))
        for seed in range(300)
        for child in [crossed(seed, MOTHER, FATHER, setting)]
    )
    # In the place of a hinge with its brick the gifts give 4 and 3 parts, in that
    # of the brick 5 and 4, in that of the other hinge 5 and 4.
    assert set(sizes) == {None, 5}


def test_nothing_mutates_where_all_probabilities_are_zero() -> None:
    setting = experiment(**STILL)
    for seed in range(20):
        genome = founder(seed)
        rng = np.random.default_rng(seed)
        assert encoding(setting).mutate(genome, rng, CHILD) == genome


def offspring(seed: int, setting: Experiment = DEFAULT) -> Genome | None:
    rng = np.random.default_rng(seed)
    pair = founder(seed, setting), founder(seed + 1, setting)
    return encoding(setting).mate(*pair, rng, CHILD)


@pytest.mark.parametrize(
    "setting",
    [
        DEFAULT,
        experiment({"max_parts": 12, "max_hidden": 3}, p_duplicate_subtree=1.0),
        experiment(
            {"max_parts": 15},
            p_delete_subtree=1.0,
            p_duplicate_subtree=0.0,
            p_delete_hidden_neuron=0.5,
            p_remove_brain_connection=0.5,
            p_swap_subtree=1.0,
        ),
        experiment({"planar": False}, body_epsilon=1.0, brain_epsilon=1.0),
    ],
    ids=["thesis", "tight", "wild", "free"],
)
@given(seed=SEEDS)
def test_children_are_well_formed_and_within_all_restrictions(
    setting: Experiment, seed: int
) -> None:
    space, types = setting.space, body_space(setting.space)
    genome = offspring(seed, setting)
    if genome is None:
        return
    robot = develop(genome, types)
    check_robot(robot, types)
    assert space.min_parts <= len(robot.parts) <= space.max_parts
    assert robot.brain.count("input") <= space.max_inputs
    assert 1 <= robot.brain.count("output") <= space.max_outputs
    assert robot.brain.count("hidden") <= space.max_hidden
    if space.planar:
        rotations, _ = place_parts(robot, shapes_of(robot, types))
        for part, rotation in zip(robot.parts, rotations, strict=True):
            for slot in types[part.kind].shape(part.parameters).slots:
                height = (rotation @ np.asarray(slot.normal))[2]
                assert height == pytest.approx(0.0, abs=1e-9)


def test_a_lineage_stays_within_all_restrictions() -> None:
    """Fifty generations without selection, so that broken paths accumulate."""
    population, thesis = [founder(seed) for seed in range(8)], encoding()
    rng = np.random.default_rng(0)
    for generation in range(50):
        children: list[Genome] = []
        while len(children) < len(population):
            first, second = rng.choice(len(population), 2, replace=False)
            child = thesis.mate(population[first], population[second], rng, CHILD)
            if child is not None:
                children.append(child)
        population = children
        for genome in population:
            check_robot(develop(genome, TYPES), TYPES)
            size = size_of(preorder(to_mutable(genome, TYPES)))
            assert all(map(le, size, size_limits(DEFAULT.space))), generation


def test_a_child_without_a_motor_is_rejected() -> None:
    motor = node("Core", (0, node("ActiveHinge")), (1, node("Hinge")))
    plain = node("Core", (0, node("Hinge")), (1, node("FixedBrick")))
    still = encoding(experiment(**STILL))
    found = [
        still.mate(motor, plain, np.random.default_rng(seed), CHILD)
        for seed in range(200)
    ]
    refused = sum(child is None for child in found)
    assert 60 < refused < 140, "half of the places are the motor's"
    assert all("ActiveHinge" in kinds(child) for child in found if child)


def test_mating_depends_on_its_stream_and_keeps_the_parents() -> None:
    first, second = founder(1), founder(2)
    pair = first, second
    one, two, other = (
        encoding().mate(*pair, np.random.default_rng(seed), CHILD) for seed in (3, 3, 4)
    )
    assert one == two != other
    assert (first, second) == (founder(1), founder(2))
