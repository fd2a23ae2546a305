"""Each rule of a well-formed robot, broken once."""

import math
from typing import Any

import pytest
from msgspec import structs
from msgspec.structs import replace

from schema.errors import InvalidRobot
from schema.parts import BUILT_IN
from schema.robot.brain import Brain, Connection, Neuron, check_brain
from schema.robot.genome import NeuronGene, develop
from schema.robot.robot import Part, Robot, check_body, check_robot, check_tree
from tests.schema.robots import node


@pytest.fixture
def robot() -> Robot:
    """Core; on slot 0 a hinge with a brick and a bar; on slot 1 a touch sensor."""
    bar = node("ParametricBarJoint")
    brick = node("FixedBrick", children=((1, bar),))
    hinge = node("ActiveHinge", children=((1, brick),))
    touch = node("TouchSensor", hidden=(NeuronGene("Oscillator", (1.0, 0.0, 1.0)),))
    return develop(node("Core", children=((0, hinge), (1, touch))), BUILT_IN)


def with_part(robot: Robot, index: int, **changes: Any) -> Robot:  # noqa: ANN401
    parts = list(robot.parts)
    parts[index] = structs.replace(parts[index], **changes)
    return replace(robot, parts=tuple(parts))


def with_neuron(robot: Robot, index: int, **changes: Any) -> Robot:  # noqa: ANN401
    neurons = list(robot.brain.neurons)
    neurons[index] = structs.replace(neurons[index], **changes)
    return replace(robot, brain=replace(robot.brain, neurons=tuple(neurons)))


def wired(robot: Robot, *connections: Connection) -> Robot:
    return replace(robot, brain=replace(robot.brain, connections=connections))


def test_well_formed(robot: Robot) -> None:
    check_robot(robot, BUILT_IN)
    layers = [neuron.layer for neuron in robot.brain.neurons]
    assert layers == ["input"] * 8 + ["output", "hidden"]
    check_robot(wired(robot, Connection(0, 8, 0.5), Connection(8, 8, 1.0)), BUILT_IN)


@pytest.mark.parametrize(
    ("index", "changes", "message"),
    [
        (0, {"kind": "FixedBrick"}, "exactly the first part must be a core"),
        (2, {"kind": "Core"}, "exactly the first part must be a core"),
        (2, {"kind": "Brick"}, r"kind: must be one of Core, .*, got 'Brick'"),
        (0, {"parent": 0}, "the core's parent, parent_slot and slot must be -1"),
        (0, {"slot": 0}, "the core's parent, parent_slot and slot must be -1"),
        (2, {"parent": -1}, r"parts\[2\].parent: must be 0..1, got -1"),
        (2, {"parent": 2}, r"parts\[2\].parent: must be 0..1, got 2"),
        (2, {"parent": 0, "parent_slot": 0}, r"slot 0 of body.parts\[0\] is taken"),
        (2, {"parent_slot": 0}, r"slot 0 of body.parts\[1\] is taken"),
        (3, {"parent_slot": 0}, r"slot 0 of body.parts\[2\] is taken"),
        (3, {"parent_slot": 4}, r"parent_slot: FixedBrick has slots 0..3, got 4"),
        (3, {"slot": 2}, r"\.slot: ParametricBarJoint has slots 0..1, got 2"),
        (3, {"slot": -1}, r"slot: must be >= 0, got -1"),
        (3, {"parent_slot": -2}, r"parent_slot: must be >= 0, got -2"),
        (4, {"parent": 2, "parent_slot": 0}, r"slot 0 of body.parts\[2\] is taken"),
        (1, {"parent_slot": 2}, "depth-first order, children by ascending slot"),
        (1, {"orientation": 45}, r"orientation: must be one of .*, got 45"),
        (1, {"orientation": 360}, "orientation: must be one of"),
        (1, {"parameters": (0.5, 0.5)}, "ActiveHinge takes 3, got 2"),
        (1, {"parameters": (0.5, 0.5, 1.5)}, r"blue: must be in \[0.0, 1.0\], got 1.5"),
        (1, {"parameters": (0.5, math.nan, 0.5)}, "parameters: must be finite"),
        (1, {"parameters": (-math.inf, 0.5, 0.5)}, "parameters: must be finite"),
        (3, {"parameters": (19.0, 0.0, 0.0, 0.5, 0.5, 0.5)}, "connection_length"),
        (3, {"parameters": (50.0, 0.0, 0.1, 0.5, 0.5, 0.5)}, "beta: must be in"),
        (1, {"gene": -1}, "gene: must be"),
        (1, {"gene": 2**64}, "gene: must be"),
    ],
)
def test_broken_body(
    robot: Robot, index: int, changes: dict[str, Any], message: str
) -> None:
    with pytest.raises(InvalidRobot, match=message):
        check_robot(with_part(robot, index, **changes), BUILT_IN)


def test_body_without_parts_is_refused() -> None:
    with pytest.raises(InvalidRobot, match="must have at least the core"):
        check_robot(Robot(()), BUILT_IN)


def test_breadth_first_order_is_refused(robot: Robot) -> None:
    core, hinge, brick, _, touch = robot.parts
    with pytest.raises(InvalidRobot, match=r"parts\[3\]: .* depth-first order"):
        check_tree((core, hinge, touch, brick))


def test_tree_check_ignores_types() -> None:
    colour = (0.5,)
    check_tree((Part("Hub", -1, -1, -1, 0, colour), Part("Fin", 0, 77, 5, 270, colour)))


def test_a_body_is_checked_without_a_brain(robot: Robot) -> None:
    bare = Robot(robot.parts)
    check_body(bare.parts, BUILT_IN)
    with pytest.raises(InvalidRobot, match="brain: input neurons"):
        check_robot(bare, BUILT_IN)
    core_only = {"Core": BUILT_IN["Core"]}
    with pytest.raises(InvalidRobot, match=r"parts\[1\].kind: must be one of Co"):
        check_body(bare.parts, core_only)


def test_unknown_types_are_refused(robot: Robot) -> None:
    space = {name: kind for name, kind in BUILT_IN.items() if name != "TouchSensor"}
    with pytest.raises(InvalidRobot, match="got 'TouchSensor'"):
        check_robot(robot, space)


@pytest.mark.parametrize(
    ("index", "changes", "message"),
    [
        (9, {"part": 9}, r"neurons\[9\].part: must be 0..4, got 9"),
        (0, {"layer": "hidden", "kind": "Simple"}, "inputs, then outputs, then hidden"),
        (0, {"part": 4}, "each by ascending part"),
        (0, {"kind": "Simple"}, r"kind: must be one of Input, got 'Simple'"),
        (9, {"kind": "Input"}, "must be one of Simple, Sigmoid, Oscillator"),
        (9, {"kind": "Cosine"}, "must be one of Simple, Sigmoid, Oscillator"),
        (9, {"parameters": (1.0, 0.0)}, "Oscillator takes 3, got 2"),
        (9, {"parameters": (1.0, 0.0, math.inf)}, "parameters: must be finite"),
        (0, {"parameters": (1.0,)}, "Input takes 0, got 1"),
        (8, {"part": 2}, r"output neurons must belong to parts \[1\], got \[2\]"),
    ],
)
def test_broken_neuron(
    robot: Robot, index: int, changes: dict[str, Any], message: str
) -> None:
    with pytest.raises(InvalidRobot, match=message):
        check_robot(with_neuron(robot, index, **changes), BUILT_IN)


@pytest.mark.parametrize("missing", [7, 8])
def test_missing_neuron(robot: Robot, missing: int) -> None:
    neurons = list(robot.brain.neurons)
    del neurons[missing]
    with pytest.raises(InvalidRobot, match="neurons must belong to parts"):
        check_robot(replace(robot, brain=Brain(tuple(neurons))), BUILT_IN)


@pytest.mark.parametrize(
    ("connection", "message"),
    [
        (Connection(10, 8, 0.5), r"connections\[0\].source: must be 0..9, got 10"),
        (Connection(-1, 8, 0.5), "source: must be 0..9, got -1"),
        (Connection(0, 10, 0.5), "target: must be 0..9, got 10"),
        (Connection(8, 7, 0.5), "target: must not be an input"),
        (Connection(8, 9, math.nan), "weight: must be finite, got nan"),
    ],
)
def test_broken_connection(robot: Robot, connection: Connection, message: str) -> None:
    with pytest.raises(InvalidRobot, match=message):
        check_robot(wired(robot, connection), BUILT_IN)


def test_one_connection_per_ordered_pair(robot: Robot) -> None:
    there, back = Connection(8, 9, 0.5), Connection(9, 8, 0.5)
    check_robot(wired(robot, there, back), BUILT_IN)
    with pytest.raises(InvalidRobot, match=r"connections\[2\]: second .* 8 -> 9"):
        check_robot(
            wired(robot, there, back, structs.replace(there, weight=0.1)), BUILT_IN
        )


def test_a_brain_is_checked_without_a_body() -> None:
    brain = Brain((Neuron("hidden", "Simple", 3, (0.0, 0.5)),))
    check_brain(brain, 4)
    with pytest.raises(InvalidRobot, match=r"must be 0\.\.2, got 3"):
        check_brain(brain, 3)
