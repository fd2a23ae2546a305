"""Part types and sensors that are refused, and why."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any, cast

import pytest
from msgspec.structs import replace as changed

from schema import parts, robogen_parts
from schema.errors import ExperimentError
from schema.experiment.document import Space, body_space
from schema.parts import (
    ACTIVE_HINGE,
    BUILT_IN,
    FIXED_BRICK,
    HINGE,
    PARAMETRIC_BAR_JOINT,
    TOUCH_SENSOR,
    Parameter,
    PartType,
    Sensor,
    Shape,
)
from schema.plugins.part_checks import check_part_type
from schema.plugins.sensor_checks import check_sensor, ray_problem
from schema.plugins.slot_checks import advise_shape, check_slots_and_sensors

HINGED = ACTIVE_HINGE.shape(())
BRICK = FIXED_BRICK.shape(())
ROBOGEN = [kind for kind in vars(robogen_parts).values() if isinstance(kind, PartType)]


def shaped(kind: PartType, shape: Shape) -> PartType:
    """Return a type with another, constant shape."""
    return replace(kind, shape=lambda _values: shape)


def boxed(**changes: Any) -> PartType:  # noqa: ANN401 - any attribute of a box
    """Return a brick with its box changed."""
    box = changed(BRICK.boxes[0], **changes)
    return shaped(FIXED_BRICK, changed(BRICK, boxes=(box,)))


def slotted(**changes: Any) -> PartType:  # noqa: ANN401 - any attribute of a slot
    """Return a brick with its second slot changed."""
    first, second, *rest = BRICK.slots
    return shaped(
        FIXED_BRICK, changed(BRICK, slots=(first, changed(second, **changes), *rest))
    )


def jointed(**changes: Any) -> PartType:  # noqa: ANN401 - any attribute of a joint
    """Return a hinge with its joint changed."""
    assert HINGED.joint is not None
    return shaped(ACTIVE_HINGE, changed(HINGED, joint=changed(HINGED.joint, **changes)))


def driven(**changes: Any) -> PartType:  # noqa: ANN401 - any attribute of a motor
    """Return a hinge with its motor changed."""
    assert ACTIVE_HINGE.motor is not None
    return replace(ACTIVE_HINGE, motor=replace(ACTIVE_HINGE.motor, **changes))


def measured(*own: Parameter) -> PartType:
    """Return a brick with parameters."""
    return replace(FIXED_BRICK, own_parameters=own)


def sensing(*sensors: Sensor) -> PartType:
    """Return a touch sensor with other sensors."""
    return replace(TOUCH_SENSOR, sensors=sensors)


def _nothing(_values: tuple[float, ...]) -> None:
    pass


def _thin(values: tuple[float, ...]) -> Shape:
    """Return a brick of a size that the parameter may make 0."""
    size = (values[0], 0.041, 0.0355)
    return changed(BRICK, boxes=(changed(BRICK.boxes[0], size=size),))


def _raising(values: tuple[float, ...]) -> Shape:
    return _thin((1.0 / values[0],))


def _wordy(values: tuple[float, ...]) -> Shape:
    if values[0] == 0.0:
        raise ValueError("two\nlines")
    return _thin(values)


_TURN = ((0.0, 1.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0))
"""A mirror image, no rotation."""
_THIRD = changed(HINGED.slots[1], segment=2)
_TAILS = tuple(box for box in HINGED.boxes if box.segment == 1)
_SIZE = Parameter("size", 0.0, 1.0, 0.5)

WRONG = [
    (replace(FIXED_BRICK, arity=3), "slots: must be 3, the arity, got 4"),
    (replace(FIXED_BRICK, arity=0), "arity: must be .* >= 1, got 0"),
    (replace(FIXED_BRICK, name=" "), "name: must not be empty, got ' '"),
    (boxed(size=(0.1, 0.0, 0.1)), r"boxes\[0\] \(body\).size\[1\]: .* > 0.0, got"),
    (boxed(size=(0.1, 0.1)), r"size: must be .* length 3, got \(0.1, 0.1\)"),
    (boxed(is_round=True, size=(0.1, 0.2, 0.1)), "have equal x and y in a cylinder"),
    (boxed(mass=math.nan), "mass: must be a number > 0.0, got nan"),
    (boxed(mass=0.0), "mass: must be a number > 0.0, got 0.0"),
    (
        boxed(position=(0.0, math.inf, 0.0)),
        r"position\[1\]: must be a number that is finite",
    ),
    (boxed(rotation=_TURN), "rotation: must be a rotation matrix"),
    (boxed(segment=1), "segment: must be 0 without a joint, got 1"),
    (boxed(size=[0.1, 0.1, 0.1]), "must hold tuples and numbers only"),
    (slotted(normal=(0.0, 2.0, 0.0)), r"slots\[1\].normal: must be .* length 1, got"),
    (slotted(tangent=(0.0, 0.6, 0.8)), r"slots\[1\].tangent: must be at right angles"),
    (slotted(segment=1), "segment: must be 0 without a joint, got 1"),
    (
        shaped(HINGE, changed(HINGED, slots=(*HINGED.slots[:1], _THIRD))),
        "segment: must be 0 or 1 with a joint, got 2",
    ),
    (jointed(axis=(1.0, 1.0, 0.0)), "joint.axis: must be of length 1"),
    (jointed(limit=-1.0), "joint.limit: must be .* > 0.0, got -1.0"),
    (jointed(limit=math.inf), "joint.limit: must be .* > 0, got inf"),
    (jointed(kind="continuous"), "joint.limit: must be infinite if continuous, got 0"),
    (jointed(kind="ball"), "kind: must be one of revolute, continuous, .* got 'ball'"),
    (jointed(kind="continuous", limit=math.inf), "motor.control: must be 'velocity'"),
    (replace(FIXED_BRICK, motor=ACTIVE_HINGE.motor), "motor: must have a joint, got a"),
    (driven(max_torque=0.0), "max_torque: must be a number > 0.0, got 0"),
    (driven(control="force"), "control: must be one of position, velocity"),
    (shaped(HINGE, changed(HINGED, boxes=_TAILS)), "least one in segment 0, got none"),
    (shaped(FIXED_BRICK, changed(BRICK, boxes=2 * BRICK.boxes)), "two named 'body'"),
    (
        measured(Parameter("a", 1.0, 0.5, 0.7)),
        r"0\] \(a\): must have .*\(1.0, 0.7, 0.5",
    ),
    (measured(Parameter("size", 0.0, 1.0, 2.0)), r"got \(0.0, 2.0, 1.0\)"),
    (measured(replace(_SIZE, unit=cast("str", 1))), "unit: must be a text, got 1"),
    (measured(Parameter("red", 0.0, 1.0, 0.5)), "own_parameters: .* two named 'red'"),
    (replace(measured(_SIZE), shape=_thin), r"got \(0.0, .* \(with size = 0, then"),
    (replace(measured(_SIZE), shape=_raising), r"raised ZeroDiv.* \(with size = 0, th"),
    (replace(measured(_SIZE), shape=_wordy), r"raised ValueError: two lines \(with si"),
    (sensing(Sensor("touch", "middle")), "be one of base, left, right, got 'middle'"),
    (sensing(Sensor(cast("Any", "smell"), "left")), "imu, touch, light, got 'smell'"),
    (replace(FIXED_BRICK, shape=cast("Any", BRICK)), "raised TypeError: .*callable"),
    (
        replace(FIXED_BRICK, shape=cast("Any", _nothing)),
        "must return a Shape, got None",
    ),
]
PAIR = (Sensor("imu", "left"), Sensor("imu", "right"))
PAD = boxed(name="pad/left")
UNSUITABLE = [
    (slotted(normal=(0.0, -1.0, 0.0)), r"\[1\].normal: must point out .* 41 mm deep"),
    (sensing(*PAIR), "sensors: must have imus on one box only, got"),
    (
        replace(PAD, sensors=(Sensor("touch", "pad/left"),)),
        "no '/' in the name of a box",
    ),
]


@pytest.mark.parametrize("kind", [*BUILT_IN.values(), *ROBOGEN])
def test_built_in_part_types_pass(kind: PartType) -> None:
    check_part_type(kind)
    check_slots_and_sensors(kind)
    assert advise_shape(kind) == ""


@pytest.mark.parametrize(("kind", "message"), UNSUITABLE)
def test_parts_that_finished_runs_may_have_are_refused_by_another_check(
    kind: PartType, message: str
) -> None:
    check_part_type(kind)
    with pytest.raises(ExperimentError, match=message):
        check_slots_and_sensors(kind)


def test_two_imus_of_one_box_and_an_imu_of_a_box_with_a_slash_pass() -> None:
    sensors = (*PAIR[:1] * 2, Sensor("touch", "left"))
    check_slots_and_sensors(sensing(*sensors))
    check_slots_and_sensors(replace(PAD, sensors=(Sensor("imu", "pad/left"),)))


@pytest.mark.parametrize(("y", "away"), [(0.0305, "10"), (0.0105, "10")])
def test_a_slot_off_the_surface_gets_a_warning(y: float, away: str) -> None:
    """The brick's faces are 20.5 mm from its centre."""
    advice = advise_shape(slotted(position=(0.0, y, 0.0)))
    assert advice.startswith(f"slots[1].position is {away} mm from the surface")


def test_a_limit_in_degrees_gets_a_warning() -> None:
    advice = advise_shape(jointed(limit=60.0))
    assert advice.endswith("60 degrees are 1.05 rad")
    assert advise_shape(jointed(limit=3.0)) == ""


@pytest.mark.parametrize(("kind", "message"), WRONG)
def test_wrong_part_types_are_refused(kind: PartType, message: str) -> None:
    with pytest.raises(ExperimentError, match=message) as caught:
        check_part_type(kind, "space.part_types")
    text = str(caught.value)
    assert text.startswith("space.part_types: ")
    assert "\n" not in text
    assert f"part type {kind.name!r}: " in text


def test_the_message_names_file_and_line_of_the_shape() -> None:
    kind = replace(measured(_SIZE), shape=_thin)
    line = _thin.__code__.co_firstlineno
    with pytest.raises(ExperimentError, match=rf"_checks.py:{line}: part type"):
        check_part_type(kind)


def tried(kind: PartType) -> set[tuple[float, ...]]:
    """Return the own parameters with which the shape of a type is made."""
    seen: list[tuple[float, ...]] = []

    def record(values: tuple[float, ...]) -> Shape:
        seen.append(values[:-3])
        return kind.shape(values)

    check_part_type(replace(kind, shape=record))
    return set(seen)


def test_of_many_parameters_each_extreme_is_tried_alone() -> None:
    own = [Parameter(f"p{number}", -1.0, 2.0, 0.0) for number in range(9)]
    corners = tried(measured(*own))
    assert len(corners) == 1 + 2 * 9
    assert (0.0,) * 8 + (2.0,) in corners


def test_all_corners_of_the_bar_are_tried() -> None:
    half = math.pi / 2
    corners = {(x, a, 0.0) for x in (20.0, 100.0) for a in (-half, half)}
    assert tried(PARAMETRIC_BAR_JOINT) == corners | {(50.0, 0.0, 0.0)}


def test_a_document_with_a_wrong_part_type_is_refused(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    wrong = slotted(normal=(0.0, 0.0, 0.0))
    monkeypatch.setattr(parts, "WRONG", wrong, raising=False)
    space = Space(part_types=("schema.parts:CORE", "schema.parts:WRONG"))
    with pytest.raises(ExperimentError, match=r"space.part_types: .*slots\[1\].normal"):
        body_space(space)


@dataclass
class Nose:
    """Sensor whose values are given, or computed from what it has seen."""

    values: Any = (0.5,)
    inputs: Any = 1
    calls: list[Any] = field(default_factory=list)

    def read(self, view: Any) -> Sequence[float]:  # noqa: ANN401
        self.calls.append(view)
        found: Any = self.values
        return found(self.calls) if callable(found) else found  # type: ignore[no-any-return]


def wordy(_calls: list[Any]) -> Sequence[float]:
    raise RuntimeError("two\nlines")


def reaching(calls: list[Any]) -> Sequence[float]:
    return (float(calls[-1].position("tip")[0]),)


def longsighted(calls: list[Any]) -> Sequence[float]:
    return (calls[-1].distance("body", (1.0, 1.0, 0.0), 0.5),)


@pytest.mark.parametrize(
    ("sensor", "message"),
    [
        (Nose((0.5, 0.5)), r"Nose.read .* must return 1 values.* got 2"),
        (Nose((math.nan,)), r"must return finite numbers, got \[nan\]"),
        (Nose("5"), "must return numbers, got '5'"),
        (Nose(None), "must return numbers, got None"),
        (Nose((), 0), "inputs: must be a whole number from 1 .* got 0"),
        (Nose((0.5,), 0.5), "inputs: must be a whole number.* got 0.5"),
        (Nose(lambda calls: (float(len(calls)),)), "must return the same twice, got"),
        (Nose(lambda calls: (calls[-1].light[2],)), "a part at birth: TypeError"),
        (Nose(wordy), "Nose.read of a part at birth: .*: two lines$"),
        (Nose(longsighted), r"direction must have length 1, got \(1.0, 1.0, 0.0"),
        (object(), "inputs: must be a whole number.* got None"),
    ],
)
def test_wrong_sensors_are_refused(sensor: Any, message: str) -> None:  # noqa: ANN401
    with pytest.raises(ExperimentError, match=message) as caught:
        check_sensor(sensor)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("x", [math.nan, math.inf, 1.1])
def test_the_direction_of_a_ray_has_length_1(x: float) -> None:
    with pytest.raises(ValueError, match="direction must have length 1, got"):
        ray_problem((x, 0.0, 0.0), 1.0, (0.0, 0.0, 0.0))


def test_sensors_of_a_part_type_read_views_of_its_boxes() -> None:
    nose = Nose()
    check_part_type(replace(HINGE, sensors=(nose,)))
    assert [type(view).__name__ for view in nose.calls] == ["HandMadeView"] * 6
    view: Any = nose.calls[0]
    assert view.position("conn_b").tolist() == [0.0276, 0.0, 0.0]
    with pytest.raises(ExperimentError, match=r"^x: .*sensors\[0\]: .*Nose.read"):
        check_part_type(replace(HINGE, sensors=(Nose(reaching),)), "x")
