"""Frames of parts: positions and rule of the original code."""

import math

import numpy as np
import pytest
from hypothesis import given

from schema.parts import BUILT_IN, Slot
from schema.robot.frames import attach, place_parts, shapes_of
from schema.robot.genome import Genome, Node, develop
from schema.robot.robot import Part, Robot
from schema.robot.trace import Floats
from tests.schema.robots import CORE, GREY, node, random_genomes, random_robots


def turned(vector: Floats, axis: Floats, degrees: float) -> Floats:
    """Return a vector turned about a unit axis, by Rodrigues' formula."""
    angle = math.radians(degrees)
    along = axis * np.dot(axis, vector)
    return np.asarray(
        vector * math.cos(angle)
        + np.cross(axis, vector) * math.sin(angle)
        + along * (1 - math.cos(angle))
    )


def world(slot: Slot, rotation: Floats, position: Floats) -> tuple[Floats, ...]:
    """Return a slot's position, normal and tangent in the core's frame."""
    return (
        rotation @ slot.position + position,
        rotation @ slot.normal,
        rotation @ slot.tangent,
    )


def level(genome: Genome, above: int = 0) -> Genome:
    """Return a genome whose bricks and bars lie in the core's plane."""
    turn = genome.orientation
    if BUILT_IN[genome.kind].is_levelled:
        turn = -above % 360
    below = (above + turn) % 360
    return Node(
        genome.kind,
        genome.slot,
        turn,
        genome.parameters,
        children=tuple((slot, level(child, below)) for slot, child in genome.children),
    )


def body(genome: Genome) -> Robot:
    """Return a body alone: `develop` takes any number of outputs."""
    return develop(genome, BUILT_IN)


def test_golden_position_of_a_hinge_on_the_front() -> None:
    core = node("Core", children=((0, node("Hinge")),))
    robot = body(core)
    rotations, positions = place_parts(robot, shapes_of(robot, BUILT_IN))
    assert (rotations[0] == np.eye(3)).all()
    assert (positions[0] == 0.0).all()
    boxes = BUILT_IN["Hinge"].shape(core.children[0][1].parameters).boxes
    centres = {box.name: rotations[1] @ box.position + positions[1] for box in boxes}
    assert centres["root"] == pytest.approx((0.0, -0.04575, 0.0), abs=1e-12)
    assert centres["conn_a"] == pytest.approx((0.0, -0.05685, 0.0), abs=1e-12)


def test_a_brick_at_the_end_of_a_tilted_bar() -> None:
    """By hand: on the core's right face the bar's x is x, its z is -y.

    The brick's centre is 20.5 + 0.75 mm along the bar's end, which points 30 degrees
    from x to y and begins 45 + 0.75 + 50 + 1.5 mm from the core's centre.
    """
    bar = Part("ParametricBarJoint", 0, 2, 0, 0, (50.0, math.pi / 6, 0.0, *GREY))
    robot = Robot((CORE, bar, Part("FixedBrick", 1, 1, 1, 0, GREY)))
    rotations, positions = place_parts(robot, shapes_of(robot, BUILT_IN))
    cosine, sine = math.sqrt(0.75), 0.5
    assert rotations[1] == pytest.approx(
        np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]]), abs=1e-12
    )
    along = np.array([cosine, sine, 0.0])
    assert rotations[2] @ (0.0, -1.0, 0.0) == pytest.approx(along, abs=1e-12)
    centre = np.array([0.09725, 0.0, 0.0]) + 0.02125 * along
    assert positions[2] == pytest.approx(centre, abs=1e-12)


def test_quarter_turn_on_the_right_face() -> None:
    """The child's own z turns to its y about -x, which then meets the core's z."""
    parent = BUILT_IN["Core"].shape(()).slots[2]
    child = BUILT_IN["ActiveHinge"].shape(()).slots[0]
    rotation, position = attach(parent, child, 90)
    expected = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, -1.0], [0.0, 1.0, 0.0]])
    assert rotation == pytest.approx(expected, abs=1e-12)
    assert position == pytest.approx((0.04575, 0.0, 0.0), abs=1e-12)


@given(robot=random_robots())
def test_rule_of_attachment(robot: Robot) -> None:
    rotations, positions = place_parts(robot, shapes_of(robot, BUILT_IN))
    slots = [BUILT_IN[p.kind].shape(p.parameters).slots for p in robot.parts]
    for index, part in enumerate(robot.parts[1:], start=1):
        above = part.parent
        place, normal, tangent = world(
            slots[above][part.parent_slot], rotations[above], positions[above]
        )
        own_place, own_normal, own_tangent = world(
            slots[index][part.slot], rotations[index], positions[index]
        )
        assert own_place == pytest.approx(place, abs=1e-9)
        assert own_normal == pytest.approx(-normal, abs=1e-9)
        met = turned(own_tangent, own_normal, part.orientation)
        assert met == pytest.approx(tangent, abs=1e-9)
        assert np.linalg.det(rotations[index]) == pytest.approx(1.0)


@given(robot=random_robots())
def test_frames_are_products_along_the_tree_to_the_last_bit(robot: Robot) -> None:
    shapes = shapes_of(robot, BUILT_IN)
    rotations, positions = place_parts(robot, shapes)
    for index, part in enumerate(robot.parts[1:], start=1):
        above = part.parent
        rotation, offset = attach(
            shapes[above].slots[part.parent_slot],
            shapes[index].slots[part.slot],
            part.orientation,
        )
        turned_by = rotations[above] @ rotation
        moved_by = positions[above] + rotations[above] @ offset
        assert rotations[index].tobytes() == turned_by.tobytes()
        assert positions[index].tobytes() == moved_by.tobytes()


@given(genome=random_genomes())
def test_level_bodies_are_flat_and_stand_on_their_core(genome: Genome) -> None:
    robot = body(level(genome))
    rotations, positions = place_parts(robot, shapes_of(robot, BUILT_IN))
    lowest = math.inf
    corners = np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    for part, rotation, position in zip(robot.parts, rotations, positions, strict=True):
        shape = BUILT_IN[part.kind].shape(part.parameters)
        for slot in shape.slots:
            assert abs((rotation @ slot.normal)[2]) < 1e-9
        for box in shape.boxes:
            local = (corners * box.size / 2) @ np.array(box.rotation).T + box.position
            lowest = min(lowest, float((local @ rotation.T + position)[:, 2].min()))
    assert lowest == pytest.approx(-0.0225, abs=1e-12)


def test_shared_frames_cannot_be_written_to() -> None:
    slot = BUILT_IN["Core"].shape(()).slots[0]
    rotation, _ = attach(slot, slot, 0)
    with pytest.raises(ValueError, match="read-only"):
        rotation[0, 0] = 2.0
