"""Mutable genome: the tree that crossover and mutation change."""

from itertools import islice

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from coordinator.evolution.mutable_genome import (
    copied,
    follow,
    free_places,
    gene_ids,
    level,
    path_between,
    preorder,
    subtree_sizes,
    to_genome,
    to_mutable,
)
from schema.experiment.document import body_space
from schema.robot.frames import place_parts, shapes_of
from schema.robot.genome import develop
from schema.robot.ids import BirthId
from tests.coordinator.genomes import NEURON, TYPES, experiment, founder, node

SEEDS = st.integers(0, 2**32 - 1)


TREE = node(
    "Core",
    (1, node("ActiveHinge", (0, node("TouchSensor")), slot=1, hidden=(NEURON,) * 2)),
    (3, node("FixedBrick", (0, node("Hinge")), (2, node("TouchSensor")), slot=3)),
)
"""Core - (1) motor - sensor; core - (3) brick - (0) hinge, (2) sensor."""


@given(SEEDS)
def test_conversion_to_a_mutable_tree_and_back_keeps_the_genome(seed: int) -> None:
    genome = founder(seed)
    root = to_mutable(genome, TYPES)
    assert to_genome(preorder(root)) == genome
    assert to_genome(preorder(copied(root))) == genome


@given(SEEDS)
def test_a_path_leads_from_its_source_to_its_target(seed: int) -> None:
    branches = preorder(to_mutable(founder(seed), TYPES))
    for source in branches:
        for target in branches:
            path = path_between(source, target)
            assert follow(source, path) is target
            assert len(path) < len(branches)


def test_a_path_goes_up_by_own_slots_and_down_by_the_parents() -> None:
    _, hinge, sensor, brick, _, pads = preorder(to_mutable(TREE, TYPES))
    assert path_between(hinge, hinge) == ()
    assert path_between(sensor, hinge) == (0,)
    assert path_between(sensor, pads) == (0, 1, 3, 2)
    assert path_between(brick, sensor) == (3, 1, 0)
    assert follow(pads, (0, 3, 2)) is None, "nothing sits on the core's slot 2"
    assert follow(pads, (0, 3, 2, 0)) is None


def test_sizes_of_all_subtrees() -> None:
    sizes = subtree_sizes(preorder(to_mutable(TREE, TYPES)))
    assert sizes == [
        (6, 10, 1, 2),
        (2, 2, 1, 2),
        (1, 2, 0, 0),
        (3, 2, 0, 0),
        (1, 0, 0, 0),
        (1, 2, 0, 0),
    ]


def test_free_places_are_the_unoccupied_slots() -> None:
    found = [
        (b.kind.name, slot)
        for b, slot in free_places(preorder(to_mutable(TREE, TYPES)))
    ]
    core = [("Core", 0), ("Core", 2)]
    assert found == [*core, ("FixedBrick", 1), ("Hinge", 1)]


def test_levelling_undoes_all_turns_before_a_brick() -> None:
    bar = node("ParametricBarJoint", slot=1, orientation=180)
    brick = node("FixedBrick", (1, node("Hinge", (1, bar), orientation=270)))
    inner = node("Hinge", (1, brick), orientation=180)
    genome = node("Core", (0, node("ActiveHinge", (1, inner), orientation=270)))
    root = to_mutable(genome, TYPES)
    level(preorder(root))
    # 270 + 180 = 90 before the brick, so it turns by 270; 270 before the bar.
    assert [b.orientation for b in preorder(root)] == [0, 270, 180, 270, 270, 90]


@given(SEEDS)
def test_all_slots_of_a_levelled_robot_point_sideways(seed: int) -> None:
    robot = develop(founder(seed), TYPES)
    rotations, _ = place_parts(robot, shapes_of(robot, TYPES))
    for part, rotation in zip(robot.parts, rotations, strict=True):
        for slot in TYPES[part.kind].shape(part.parameters).slots:
            assert (rotation @ np.asarray(slot.normal))[2] == pytest.approx(0.0)


def test_without_planarity_some_robots_leave_the_plane() -> None:
    free = experiment({"planar": False})
    types = body_space(free.space)
    turned = 0
    for seed in range(50):
        robot = develop(founder(seed, free), types)
        rotations, _ = place_parts(robot, shapes_of(robot, types))
        turned += bool(np.abs(rotations[:, 2, 0]).max() > 0.5)
    assert turned > 25


def test_gene_identities_of_different_births_differ() -> None:
    births = [BirthId(i, n) for i in (0, 1, 300) for n in (0, 1, 2999, 2**32 - 1)]
    genes = [g for birth in births for g in islice(gene_ids(birth), 100)]
    assert len(set(genes)) == len(genes)
    assert min(genes) > 0
    assert max(genes) < 2**64
