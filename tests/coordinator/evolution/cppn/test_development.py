"""Robots that develop from networks: fixed cases, limits of [space]."""

from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from msgspec.structs import replace

from analyzer.report import analyze
from coordinator.evolution.cppn.body import body_outputs, share
from coordinator.evolution.cppn.encoding import Cppn
from coordinator.evolution.cppn.network import CppnGenome, Link
from coordinator.evolution.cppn.variation import Parameters
from coordinator.evolution.encodings import outside_limits
from schema.errors import ExperimentError
from schema.experiment.document import EncodingSection, Experiment, Space, body_space
from schema.robot.brain import Neuron
from schema.robot.frames import place_parts, shapes_of
from schema.robot.ids import BirthId
from schema.robot.robot import Robot, check_robot

FIRST = BirthId(0, 0)
RULES = Parameters()


def encoding(space: Space | None = None, parameters: Parameters = RULES) -> Cppn:
    space = space or Space()
    experiment = Experiment(
        name="test", space=space, encoding=EncodingSection(type="cppn")
    )
    return Cppn(experiment, body_space(space), parameters)


def developed(*links: Link, **space: Any) -> Robot:  # noqa: ANN401 - any limit
    ordered = tuple(sorted(links, key=lambda link: link.marking))
    return encoding(Space(**space)).develop(CppnGenome((), ordered))


PART = Link("bias", "part", 3.0)
HINGES = Link("bias", "type ActiveHinge", 1.0)


def test_an_empty_network_develops_into_a_core() -> None:
    robot = developed()
    (core,) = robot.parts
    # Colours are half way between their limits, as all outputs are 0.
    assert (core.kind, core.parameters) == ("Core", (0.5, 0.5, 0.5))
    assert [neuron.layer for neuron in robot.brain.neurons] == ["input"] * 6


def test_hinges_grow_on_all_slots_level_by_level() -> None:
    robot = developed(PART, HINGES, max_parts=7)
    # Own slot: half of 2 slots is slot 1; orientation: half of 4 is 180 degrees.
    found = [
        (part.kind, part.parent, part.parent_slot, part.slot, part.orientation)
        for part in robot.parts
    ]
    assert found == [
        ("Core", -1, -1, -1, 0),
        ("ActiveHinge", 0, 0, 1, 180),
        ("ActiveHinge", 1, 0, 1, 180),
        ("ActiveHinge", 0, 1, 1, 180),
        ("ActiveHinge", 3, 0, 1, 180),
        ("ActiveHinge", 0, 2, 1, 180),
        ("ActiveHinge", 0, 3, 1, 180),
    ]


def test_a_type_at_its_limit_is_not_chosen() -> None:
    robot = developed(PART, HINGES, max_parts=7, max_outputs=2)
    kinds = [part.kind for part in robot.parts]
    # Of types with equal outputs the first of [space] grows.
    assert sorted(kinds) == ["ActiveHinge"] * 2 + ["Core"] + ["FixedBrick"] * 4


def test_parts_grow_only_where_the_network_says_so() -> None:
    # Output "part" is 3 x / (1 + 3 x) > 0 on the side of positive x: slot 2.
    robot = developed(Link("x2", "part", 3.0), HINGES, max_parts=2)
    assert [(part.kind, part.parent_slot) for part in robot.parts[1:]] == [
        ("ActiveHinge", 2)
    ]


def test_a_body_does_not_grow_beyond_its_reach() -> None:
    # 3 / 4 is above 0.3 (distance - 0.5) up to a distance of 0.3 m.
    robot = developed(PART, Link("bias", "type FixedBrick", 1.0), max_parts=1000)
    assert len(robot.parts) < 1000
    _, positions = place_parts(robot, shapes_of(robot, TYPES))
    # Centres of bricks lie half a brick beyond their slots.
    farthest = np.linalg.norm(positions, axis=1).max()
    assert 0.28 < farthest < 0.3 + 0.0205


def test_parameters_lie_in_their_range() -> None:
    bars = Link("bias", "type ParametricBarJoint", 1.0)
    # 1 / 2 in (-1, 1) is a share of 3 / 4: 20 + 0.75 * 80 mm.
    robot = developed(
        PART, bars, Link("bias", "part connection_length", 1.0), max_parts=2
    )
    assert robot.parts[1].parameters == (80.0, 0.0, 0.0, 0.5, 0.5, 0.5)


@pytest.mark.parametrize(
    ("output", "expected"), [(-1.0, 0.0), (0.0, 0.5), (0.5, 0.75), (1.0, 1 - 2**-53)]
)
def test_share_of_a_range(output: float, expected: float) -> None:
    assert share(output) == expected


def test_neurons_and_connections_are_queried_by_place() -> None:
    robot = developed(
        PART, HINGES,
        Link("bias", "hidden", -1.0), Link("y1", "hidden", 3.0),
        Link("bias", "kind Oscillator", 1.0), Link("bias", "neuron period", -1.0),
        # Connections from inputs alone, with a weight that their number decides.
        Link("n1", "link", -1.0), Link("n1", "weight", 1.0),
        max_parts=5,
    )  # fmt: skip
    neurons = robot.brain.neurons
    outputs = [neuron for neuron in neurons if neuron.layer == "output"]
    # Share 1 / 4 of a period of 10 s; half of 3.14 and of 2.
    assert outputs == [
        Neuron("output", "Oscillator", part, (2.5, 1.57, 1.0)) for part in (1, 2, 3, 4)
    ]
    # 3 y1 - 1 > 0 for the hinge on slot 1, at y = 0.08195 m, which is 0.8195.
    hidden = [neuron for neuron in neurons if neuron.layer == "hidden"]
    assert hidden == [Neuron("hidden", "Oscillator", 2, (2.5, 1.57, 1.0))]
    found = [
        (each.source, each.target, each.weight) for each in robot.brain.connections
    ]
    assert found == [
        (source, target, -(source + 1) / (source + 2))
        for source in range(6)
        for target in range(6, 11)
    ]


def test_a_part_does_not_grow_into_another_one() -> None:
    robots = viable(60)
    reports = [analyze(one, TYPES, EXPERIMENT.vetting) for one in robots]
    assert sum(report.is_viable for report in reports) >= 57


EXPERIMENT = Experiment(name="test")
TYPES = body_space(EXPERIMENT.space)


def viable(count: int) -> list[Robot]:
    own = encoding()
    genomes = [own.random(np.random.default_rng(seed), FIRST) for seed in range(count)]
    return [own.develop(genome) for genome in genomes]


def test_random_robots_differ_in_size_and_type() -> None:
    robots = viable(40)
    sizes = [len(robot.parts) for robot in robots]
    assert len(set(sizes)) >= 8
    kinds = {part.kind for robot in robots for part in robot.parts}
    assert kinds == set(TYPES)


@settings(max_examples=40)
@given(
    seed=st.integers(0, 2**32),
    most=st.integers(2, 40),
    inputs=st.integers(6, 12),
    outputs=st.integers(1, 12),
    hidden=st.integers(0, 12),
    planar=st.booleans(),
)
def test_all_robots_keep_all_limits(
    seed: int, most: int, inputs: int, outputs: int, hidden: int, *, planar: bool
) -> None:
    space = Space(
        min_parts=2, max_parts=most, max_inputs=inputs, max_outputs=outputs,
        max_hidden=hidden, planar=planar,
    )  # fmt: skip
    own, rng = encoding(space), np.random.default_rng(seed)
    genomes = [own.random(rng, FIRST) for _ in range(2)]
    for _ in range(4):
        child = own.mutate(own.crossover(genomes[0], genomes[1], rng), rng, FIRST)
        genomes = [genomes[1], child or genomes[0]]
        robot = own.develop(genomes[1])
        check_robot(robot, body_space(space))
        assert outside_limits(robot, space, body_space(space)) == ""
        assert robot.brain.count("output") >= 1
        again = encoding(space)
        assert again.develop(again.from_bytes(own.to_bytes(genomes[1]))) == robot


def test_a_space_without_viable_robots_is_reported(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("coordinator.evolution.cppn.encoding._MOST_TRIES", 3)
    alone = encoding(parameters=Parameters(p_connect=0.0, first_nodes=0))
    with pytest.raises(ExperimentError, match=r"'cppn': 3 random networks gave no"):
        alone.random(np.random.default_rng(1), FIRST)


def test_a_network_of_another_space_is_refused() -> None:
    small = replace(
        Space(), part_types=("schema.parts:CORE", "schema.parts:ACTIVE_HINGE")
    )
    bricks = CppnGenome((), (Link("bias", "type FixedBrick", 1.0),))
    data = encoding().to_bytes(bricks)
    assert encoding().from_bytes(data) == bricks
    with pytest.raises(ValueError, match="no node of its own"):
        encoding(small).from_bytes(data)


def test_outputs_have_the_names_of_types_and_parameters() -> None:
    names = body_outputs(TYPES)
    assert names[:4] == ("part", "turn", "slot", "type FixedBrick")
    assert names.count("part red") == 1
    assert "type Core" not in names
