"""Numbers of the part types, as in the code of the original."""

import math

import numpy as np
import pytest

from schema.parts import BUILT_IN, PartType, Shape, Vector

DEFAULTS = {
    name: tuple(parameter.default for parameter in kind.parameters)
    for name, kind in BUILT_IN.items()
}
X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)
PLATE: Vector = (1.5, 34.0, 34.0)

# By name: box, size [mm], centre [mm], mass [g], segment.
Row = tuple[str, Vector, Vector, float, int]
BOXES: dict[str, list[Row]] = {
    "Core": [("body", (90, 90, 45), (0, 0, 0), 90, 0)],
    "FixedBrick": [("body", (41, 41, 35.5), (0, 0, 0), 10.2, 0)],
    "ActiveHinge": [
        ("root", PLATE, (0, 0, 0), 7, 0),
        ("frame", (18, 34, 10), (9.85, 0, 0), 1.2, 0),
        ("servo", (24.5, 34, 10), (23.1, 0, 0), 9, 1),
        ("tail", PLATE, (36.2, 0, 0), 7, 1),
    ],
    "Hinge": [
        ("root", PLATE, (0, 0, 0), 2, 0),
        ("conn_a", (20.5, 2, 20), (11.1, 0, 0), 1, 0),
        ("conn_b", (20.5, 2, 20), (27.6, 0, 0), 1, 1),
        ("tail", PLATE, (38.7, 0, 0), 2, 1),
    ],
    "ParametricBarJoint": [
        ("root", PLATE, (0, 0, 0), 1, 0),
        ("bar", (50, 20, 2), (25.75, 0, 0), 1, 0),
        ("tail", PLATE, (51.5, 0, 0), 1, 0),
    ],
    "TouchSensor": [
        ("base", PLATE, (0, 0, 0), 3, 0),
        ("left", (9, 18.5, 16), (5.25, -10.25, 0), 3, 0),
        ("right", (9, 18.5, 16), (5.25, 10.25, 0), 3, 0),
    ],
    "LightSensor": [("base", PLATE, (0, 0, 0), 2, 0)],
}
# By name: arity, inputs, outputs, own parameters.
COUNTS = {
    "Core": (4, 6, 0, 0),
    "FixedBrick": (4, 0, 0, 0),
    "ActiveHinge": (2, 0, 1, 0),
    "Hinge": (2, 0, 0, 0),
    "ParametricBarJoint": (2, 0, 0, 3),
    "TouchSensor": (1, 2, 0, 0),
    "LightSensor": (1, 1, 0, 0),
}


def shape(name: str) -> Shape:
    return BUILT_IN[name].shape(DEFAULTS[name])


def bar(length: float, alpha: float, beta: float = 0.0) -> Shape:
    return BUILT_IN["ParametricBarJoint"].shape((length, alpha, beta, 0.5, 0.5, 0.5))


def close(got: Vector, expected: Vector) -> bool:
    return np.allclose(got, expected, rtol=0, atol=1e-12)


@pytest.mark.parametrize("name", BOXES)
def test_boxes(name: str) -> None:
    got = shape(name).boxes
    assert [box.name for box in got] == [row[0] for row in BOXES[name]]
    for box, (_, size, centre, grams, segment) in zip(got, BOXES[name], strict=True):
        assert box.size == pytest.approx([mm / 1000 for mm in size], abs=1e-12)
        assert box.position == pytest.approx([mm / 1000 for mm in centre], abs=1e-12)
        assert box.mass == pytest.approx(grams / 1000, abs=1e-12)
        assert box.segment == segment


@pytest.mark.parametrize("length", [20.0, 73.0, 100.0])
def test_mass_of_a_bar_grows_by_a_fiftieth_gram_per_millimetre(length: float) -> None:
    straight = bar(length, 0.0)
    assert sum(box.mass for box in straight.boxes) == pytest.approx(
        (2 + 0.02 * length) / 1000
    )
    ends = [slot.position for slot in straight.slots]
    assert 1000 * math.dist(*ends) == pytest.approx(length + 3.0)


@pytest.mark.parametrize("name", COUNTS)
def test_counts(name: str) -> None:
    kind = BUILT_IN[name]
    own = len(kind.own_parameters)
    assert (kind.arity, kind.inputs, kind.outputs, own) == COUNTS[name]
    assert len(shape(name).slots) == kind.arity
    assert [item.name for item in kind.parameters[own:]] == ["red", "green", "blue"]
    for colour in kind.parameters[own:]:
        assert (colour.low, colour.high, colour.default) == (0.0, 1.0, 0.5)
        assert not colour.is_mutable


@pytest.mark.parametrize(("name", "reach"), [("Core", 0.045), ("FixedBrick", 0.0205)])
def test_four_slots_front_back_right_left(name: str, reach: float) -> None:
    normals = [(0.0, -1.0, 0.0), Y, X, (-1.0, 0.0, 0.0)]
    for slot, normal in zip(shape(name).slots, normals, strict=True):
        assert close(slot.normal, normal)
        assert slot.position == pytest.approx([reach * value for value in normal])
        assert slot.tangent == Z


@pytest.mark.parametrize(
    ("name", "tangent"),
    [
        ("ActiveHinge", Z),
        ("Hinge", Z),
        ("ParametricBarJoint", Y),
        ("TouchSensor", Y),
        ("LightSensor", Y),
    ],
)
def test_slot_zero_of_a_plate(name: str, tangent: Vector) -> None:
    slot = shape(name).slots[0]
    assert slot.position == (-0.00075, 0.0, 0.0)
    assert (slot.normal, slot.tangent) == ((-1.0, 0.0, 0.0), tangent)


@pytest.mark.parametrize(("name", "x_mm"), [("ActiveHinge", 36.95), ("Hinge", 39.45)])
def test_slot_one_of_a_hinge(name: str, x_mm: float) -> None:
    slot = shape(name).slots[1]
    assert slot.position == pytest.approx((x_mm / 1000, 0.0, 0.0))
    assert (slot.normal, slot.tangent, slot.segment) == (X, Z, 1)


@pytest.mark.parametrize(
    ("name", "x", "axis", "degrees"),
    # The tail of a driven hinge turns by -angle about +y, relative to the root.
    [("ActiveHinge", 0.01485, (0.0, -1.0, 0.0), 45.0), ("Hinge", 0.01935, Z, 60.0)],
)
def test_joints(name: str, x: float, axis: Vector, degrees: float) -> None:
    joint = shape(name).joint
    assert joint is not None
    assert (joint.anchor, joint.axis) == ((x, 0.0, 0.0), axis)
    assert math.degrees(joint.limit) == pytest.approx(degrees)


def test_servo() -> None:
    motor = BUILT_IN["ActiveHinge"].motor
    assert motor is not None
    assert motor.gain == 0.9
    # 1.8 kg cm and 50 rpm.
    assert motor.max_torque == pytest.approx(1.8 * 9.81 * 0.01, abs=1e-9)
    assert motor.max_velocity == pytest.approx(50 * 2 * math.pi / 60, abs=1e-4)


def test_parameters_of_a_bar() -> None:
    ranges = [
        (p.name, p.low, p.high, p.default)
        for p in BUILT_IN["ParametricBarJoint"].own_parameters
    ]
    half = math.pi / 2
    assert ranges == [
        ("connection_length", 20.0, 100.0, 50.0),
        ("alpha", -half, half, 0.0),
        ("beta", 0.0, 0.0, 0.0),
    ]


def test_tail_of_a_bar_turns_about_its_own_y_axis() -> None:
    tilted = bar(50.0, math.pi / 2)
    tail, end = tilted.boxes[2], tilted.slots[1]
    assert tail.position == pytest.approx((0.0515, 0.0, 0.0))
    assert close(tuple(np.array(tail.rotation) @ X), (0.0, 0.0, -1.0))
    assert close(end.normal, (0.0, 0.0, -1.0))
    assert close(end.tangent, Y)
    assert close(end.position, (0.0515, 0.0, -0.00075))


@pytest.mark.parametrize(("alpha", "beta"), [(0.3, 0.0), (-1.1, 0.7), (0.0, 2.0)])
def test_frames_of_a_bar_are_right_handed(alpha: float, beta: float) -> None:
    figure = bar(40.0, alpha, beta)
    turn = np.array(figure.boxes[2].rotation)
    assert turn @ turn.T == pytest.approx(np.eye(3), abs=1e-12)
    assert np.linalg.det(turn) == pytest.approx(1.0)
    assert close(figure.slots[1].normal, tuple(turn @ X))
    assert close(figure.slots[1].tangent, tuple(turn @ Y))


@pytest.mark.parametrize("kind", BUILT_IN.values(), ids=list(BUILT_IN))
def test_flags_of_part_types(kind: PartType) -> None:
    assert kind.is_root == (kind.name == "Core")
    assert kind.is_levelled == (kind.name in {"FixedBrick", "ParametricBarJoint"})
    choosy = kind.name == "ParametricBarJoint"
    assert kind.not_on == (("ParametricBarJoint",) if choosy else ())
    assert (kind.motor is None) == (kind.name != "ActiveHinge")
