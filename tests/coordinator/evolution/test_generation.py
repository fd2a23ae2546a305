"""Random robots: validity and distributions."""

from collections import Counter
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from coordinator.evolution.generation import generate, random_brain
from schema.errors import ExperimentError
from schema.experiment.document import Experiment, Generation, Space, body_space
from schema.robot.brain import NEURON_TYPES
from schema.robot.genome import Genome, develop
from schema.robot.ids import BirthId
from schema.robot.robot import Robot, check_robot

DEFAULT = Experiment(name="test")


def make(seed: int, experiment: Experiment = DEFAULT) -> Genome:
    return generate(np.random.default_rng(seed), experiment, BirthId(2, seed))


def robots(count: int, experiment: Experiment = DEFAULT) -> list[Robot]:
    types = body_space(experiment.space)
    return [develop(make(seed, experiment), types) for seed in range(count)]


def shaped(**settings: Any) -> Experiment:  # noqa: ANN401 - any setting
    return Experiment(name="test", generation=Generation(**settings))


@given(st.integers(0, 2**32 - 1))
def test_every_robot_is_well_formed_and_within_its_limits(seed: int) -> None:
    space = DEFAULT.space
    types = body_space(space)
    robot = develop(make(seed), types)
    check_robot(robot, types)
    assert space.min_parts <= len(robot.parts) <= space.max_parts
    assert robot.brain.count("input") <= space.max_inputs
    assert 1 <= robot.brain.count("output") <= space.max_outputs
    assert robot.brain.count("hidden") <= space.max_hidden


def test_no_bar_sits_on_a_bar() -> None:
    bar = "ParametricBarJoint"
    pairs = Counter(
        (robot.parts[part.parent].kind, part.kind)
        for robot in robots(300)
        for part in robot.parts[1:]
    )
    assert pairs[bar, bar] == 0
    assert min(pairs[bar, "Hinge"], pairs["Hinge", bar]) > 20


def test_the_parts_of_a_robot_share_a_colour_but_no_identity() -> None:
    colours = set()
    genes = []
    for robot in robots(100):
        assert len({part.parameters[-3:] for part in robot.parts}) == 1
        colours.add(robot.parts[0].parameters[-3:])
        genes += [part.gene for part in robot.parts]
    assert len(colours) == 100
    assert len(set(genes)) == len(genes)


def test_the_drawn_size_is_truncated_and_clamped() -> None:
    for mean, size in ((7.9, 7), (-3.0, 3), (99.0, 30)):
        made = robots(5, shaped(parts_mean=mean, parts_sd=0.0))
        assert {len(robot.parts) for robot in made} == {size}


def test_hidden_neurons_are_uniform_in_number_and_type() -> None:
    made = robots(2200)
    found = Counter(robot.brain.count("hidden") for robot in made)
    assert sorted(found) == list(range(11))
    assert all(abs(n - 200) < 5 * 200**0.5 for n in found.values())
    kinds = Counter(n.kind for r in made for n in r.brain.neurons if n.layer != "input")
    expected = sum(kinds.values()) / 3
    assert sorted(kinds) == sorted(NEURON_TYPES)
    assert all(abs(n - expected) < 5 * expected**0.5 for n in kinds.values())


def test_each_possible_connection_is_there_with_its_probability() -> None:
    found = possible = 0
    weights = []
    for robot in robots(300):
        brain = robot.brain
        targets = brain.count("output") + brain.count("hidden")
        found += len(brain.connections)
        possible += targets * len(brain.neurons)
        weights += [edge.weight for edge in brain.connections]
    assert found / possible == pytest.approx(0.1, abs=5 * 0.3 / possible**0.5)
    assert 0.0 <= min(weights) < 0.01
    assert 0.99 < max(weights) <= 1.0
    none, all_of_them = (
        robots(20, shaped(p_connect_neurons=probability)) for probability in (0.0, 1.0)
    )
    assert all(not robot.brain.connections for robot in none)
    for robot in all_of_them:
        brain = robot.brain
        targets = brain.count("output") + brain.count("hidden")
        assert len(brain.connections) == targets * len(brain.neurons)


def test_the_least_number_of_parts_is_kept_not_only_aimed_at() -> None:
    # Two sensors and hinges that end in sensors leave no free slot soon.
    space = Space(
        part_types=(
            "schema.parts:CORE",
            "schema.parts:ACTIVE_HINGE",
            "schema.parts:TOUCH_SENSOR",
        ),
        min_parts=9,
        max_inputs=99,
    )
    experiment = Experiment(name="test", space=space)
    assert min(len(robot.parts) for robot in robots(100, experiment)) == 9


def test_impossible_restrictions_raise_an_error() -> None:
    space = Space(
        part_types=("schema.parts:CORE", "schema.parts:ACTIVE_HINGE"),
        min_parts=13,
        max_outputs=10,
    )
    with pytest.raises(ExperimentError, match=r"space\.min_parts = 13 parts"):
        make(0, Experiment(name="test", space=space))


def test_another_brain_of_a_body_is_drawn_as_that_of_a_random_robot() -> None:
    (body,) = robots(1)
    made = [random_brain(np.random.default_rng(n), body, DEFAULT) for n in range(100)]
    for robot in made:
        assert robot.parts == body.parts
        check_robot(robot, body_space(DEFAULT.space))
    assert len({robot.brain for robot in made}) == 100
    assert {robot.brain.count("hidden") for robot in made} == {*range(11)}
