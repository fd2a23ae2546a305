"""Checks of part types, built-in or own, when an experiment is loaded."""

import math
from collections.abc import Iterator, Sequence
from itertools import product
from typing import Any

import numpy as np

from schema.errors import ExperimentError, cut, error_text, shown
from schema.parts import (
    Box,
    Joint,
    Motor,
    Parameter,
    PartType,
    Sensor,
    Shape,
    Slot,
)
from schema.plugins.origin import where_defined
from schema.plugins.sensor_checks import check_sensor

_ROUNDING = 1e-6
"""Greatest deviation of a length from 1, and of a cosine from 0."""
_OFF_SURFACE_M = 0.001
"""Distance of a slot from the surface above which it gets a warning."""
_MOST_TOGETHER = 8
"""Most parameters of which all combinations of extreme values are tried."""
_KINDS = ("imu", "touch", "light")
_JOINTS = ("revolute", "continuous", "prismatic")
_EMPTY = Shape((), ())
_CONTROLS = ("position", "velocity")


def check_part_type(kind: PartType, where: str = "part type") -> None:
    """Raise unless a part type is consistent, with all extreme parameters.

    Shapes are made twice for each combination of lowest and highest values; with more
    than 8 parameters, for each extreme value alone. Own sensors read hand-made views.

    Args:
        kind: the part type.
        where: the key that names it, for messages.

    Raises:
        ExperimentError: slots that do not fit the arity; a name used twice; sizes,
            masses, ranges, axes, normals or tangents that are not what they must be;
            segments without joint; a motor without joint; sensors of no box; a shape
            that raises, differs from call to call, or is not hashable.
    """
    if problem := next(_problems(kind), ""):
        raise _refusal(kind, where, problem)
    shape = kind.shape(_default(kind))
    for number, sensor in enumerate(kind.sensors):
        if not isinstance(sensor, Sensor):
            check_sensor(sensor, f"{where}: {kind.name}.sensors[{number}]", shape)


def check_slot_directions(kind: PartType, where: str = "part type") -> None:
    """Raise if a slot of a consistent part type points into its own part.

    It is not part of ``check_part_type``: runs that were started before this check can
    be resumed.

    Args:
        kind: the part type.
        where: the key that names it, for messages.

    Raises:
        ExperimentError: there is such a slot, for extreme or other parameters.
    """
    for values in _extremes(kind):
        shape = kind.shape(values)
        for number, slot in enumerate(shape.slots):
            at = f"slots[{number}]"
            if problem := next(_direction_problems(slot, shape.boxes, at), ""):
                raise _refusal(kind, where, problem)


def check_sensed_boxes(kind: PartType, where: str = "part type") -> None:
    """Raise if a model cannot hold the sensors of a consistent part type.

    It is not part of ``check_part_type``, as ``check_slot_directions``.

    Args:
        kind: the part type.
        where: the key that names it, for messages.

    Raises:
        ExperimentError: imus on two boxes, as a part has one site for them; a touch
            sensor of a box whose name MJCF files cannot hold.
    """
    sensors = [sensor for sensor in kind.sensors if isinstance(sensor, Sensor)]
    imus = sorted({sensor.box for sensor in sensors if sensor.kind == "imu"})
    if len(imus) > 1:
        boxes = ", ".join(map(shown, imus))
        raise _refusal(kind, where, f"sensors: imus must be on one box, got {boxes}")
    for sensor in sensors:
        if sensor.kind == "touch" and "/" in sensor.box:
            problem = f"a box with a touch sensor must have no '/', got {sensor.box!r}"
            raise _refusal(kind, where, f"boxes: the name of {problem}")


def advise_shape(kind: PartType) -> str:
    """Return a warning about the shape of a part, or nothing.

    It is about a slot that is not on the part's surface, or a joint that turns further
    than once: its limit may be in degrees.

    Args:
        kind: a consistent part type.
    """
    for values in _extremes(kind):
        shape = kind.shape(values)
        joint = shape.joint
        if joint and joint.kind == "revolute" and math.tau < joint.limit < math.inf:
            return (
                f"joint.limit is {joint.limit:g} rad, more than a turn: "
                f"{joint.limit:g} degrees are {math.radians(joint.limit):.3g} rad"
            )
        for number, slot in enumerate(shape.slots):
            away_m = _distance_from_surface(slot, shape.boxes)
            if away_m > _OFF_SURFACE_M:
                return (
                    f"slots[{number}].position is {1000 * away_m:.3g} mm from the "
                    f"surface of the boxes of segment {slot.segment}: attached parts "
                    "float or sink by as much"
                )
    return ""


def _distance_from_surface(slot: Slot, boxes: Sequence[Box]) -> float:
    """Return how far a slot is from the nearest surface of its segment's boxes [m].

    Within a box its nearest face counts, hidden or not. 0 if the segment has no box. A
    cylinder counts as the box around it.
    """
    outside, inside = math.inf, 0.0
    for box in boxes:
        if box.segment != slot.segment:
            continue
        turn = np.array(box.rotation, dtype=np.float64).T
        place = turn @ np.subtract(slot.position, box.position)
        beyond = abs(place) - np.array(box.size) / 2.0
        outside = min(outside, float(np.linalg.norm(np.maximum(beyond, 0.0))))
        inside = max(inside, -float(beyond.max()))
    return outside if 0.0 < outside < math.inf else inside


def _refusal(kind: PartType, where: str, problem: str) -> ExperimentError:
    return ExperimentError(
        f"{where}: {where_defined(kind.shape)}: part type {shown(kind.name)}: {problem}"
    )


def _problems(kind: PartType) -> Iterator[str]:
    """Yield what is wrong with a part type; each check relies on those before it."""
    if not kind.name.strip():
        yield f"name: must not be empty, got {shown(kind.name)}"
    if kind.arity < 1:
        yield f"arity: must be a whole number >= 1, got {shown(kind.arity)}"
    for number, parameter in enumerate(kind.own_parameters):
        yield from _parameter_problems(parameter, f"own_parameters[{number}]")
    names = [parameter.name for parameter in kind.parameters]
    if doubled := _doubled(names):
        yield f"own_parameters: two are named {shown(doubled)}"
    if kind.motor is not None:
        yield from _motor_problems(kind.motor)
    yield from _sensor_kinds(kind.sensors)
    for values in _extremes(kind):
        for problem in _shape_problems(kind, values):
            own = ", ".join(
                f"{parameter.name} = {value:g}"
                for parameter, value in zip(kind.own_parameters, values, strict=False)
            )
            yield f"{problem}{f' (with {own}, then three colours)' if own else ''}"


def _parameter_problems(parameter: Parameter, at: str) -> Iterator[str]:
    low, high, default = parameter.low, parameter.high, parameter.default
    if not _are_finite((low, high, default)) or not low <= default <= high:
        yield (
            f"{at} ({parameter.name}): must be finite with low <= default <= high, "
            f"got {shown(low)}, {shown(default)}, {shown(high)}"
        )
    unit: Any = parameter.unit
    if not isinstance(unit, str):
        yield f"{at}.unit ({parameter.name}): must be a text, got {shown(unit)}"


def _motor_problems(motor: Motor) -> Iterator[str]:
    if motor.control not in _CONTROLS:
        yield f"motor.control: {_one_of(_CONTROLS, motor.control)}"
    for name in ("max_torque", "max_velocity", "gain"):
        value = getattr(motor, name)
        is_unused = name == "gain" and motor.control == "velocity"
        if not _are_finite((value,)) or (value <= 0.0 and not is_unused):
            yield f"motor.{name}: must be finite and > 0, got {shown(value)}"


def _sensor_kinds(sensors: Sequence[object]) -> Iterator[str]:
    for number, sensor in enumerate(sensors):
        if isinstance(sensor, Sensor) and sensor.kind not in _KINDS:
            yield f"sensors[{number}].kind: {_one_of(_KINDS, sensor.kind)}"


def _default(kind: PartType) -> tuple[float, ...]:
    return tuple(parameter.default for parameter in kind.parameters)


def _extremes(kind: PartType) -> Iterator[tuple[float, ...]]:
    """Yield the default parameters, then combinations of extreme ones."""
    default, count = _default(kind), len(kind.own_parameters)
    yield default
    ends = [sorted({each.low, each.high}) for each in kind.own_parameters]
    if 0 < count <= _MOST_TOGETHER:
        for own in product(*ends):
            yield (*own, *default[count:])
    elif count:
        for index, values in enumerate(ends):
            for value in values:
                yield (*default[:index], value, *default[index + 1 :])


def _shape(kind: PartType, values: tuple[float, ...]) -> tuple[Shape, str]:
    """Return the shape of some parameters, or an empty one and what is wrong."""
    try:
        found: list[object] = [kind.shape(values), kind.shape(values)]
    except Exception as error:  # noqa: BLE001 - any error of the user's code
        return _EMPTY, cut(f"shape raised {error_text(error)}")
    shape = found[0]
    if not isinstance(shape, Shape):
        return _EMPTY, f"shape: must return a Shape, got {shown(shape)}"
    try:
        hash(shape)
    except TypeError as error:
        return _EMPTY, f"shape: all of it must be tuples and numbers, got an {error}"
    # NaN differs from itself; what is not finite has a message of its own.
    if shape != found[1] and repr(shape) != repr(found[1]):
        return _EMPTY, "shape: must be equal for equal parameters, got different ones"
    return shape, ""


def _shape_problems(kind: PartType, values: tuple[float, ...]) -> Iterator[str]:
    """Yield what is wrong with the shape of some parameters."""
    shape, problem = _shape(kind, values)
    if problem:
        yield problem
        return
    if len(shape.slots) != kind.arity:
        got = len(shape.slots)
        yield f"slots: must be {kind.arity}, the arity, got {got}"
    for number, slot in enumerate(shape.slots):
        yield from _slot_problems(slot, f"slots[{number}]")
    names = [box.name for box in shape.boxes]
    if doubled := _doubled(names):
        yield f"boxes: two are named {shown(doubled)}"
    for number, box in enumerate(shape.boxes):
        yield from _box_problems(box, f"boxes[{number}] ({box.name})")
    yield from _joint_problems(kind, shape)
    for number, sensor in enumerate(kind.sensors):
        if isinstance(sensor, Sensor) and sensor.box not in names:
            yield f"sensors[{number}].box: {_one_of(names, sensor.box)}"


def _joint_problems(kind: PartType, shape: Shape) -> Iterator[str]:
    """Yield what is wrong with joint, motor and segments."""
    used = {box.segment for box in shape.boxes}
    used.update(slot.segment for slot in shape.slots)
    allowed = (0,) if shape.joint is None else (0, 1)
    for segment in sorted(used.difference(allowed)):
        yield (
            f"segment: must be {' or '.join(map(str, allowed))} "
            f"{'without' if shape.joint is None else 'with'} a joint, got {segment}"
        )
    needed = {0} if kind.is_root else set()
    if shape.joint is not None:
        needed = {0, 1}
        yield from _axis_problems(shape.joint)
    elif kind.motor is not None:
        yield "motor: needs a joint, and the shape has none"
    if missing := needed.difference(box.segment for box in shape.boxes):
        yield f"boxes: segment {min(missing)} must have at least one, got none"
    if shape.joint is None or kind.motor is None:
        return
    if shape.joint.kind == "continuous" and kind.motor.control != "velocity":
        yield "motor.control: must be 'velocity' for a continuous joint, got 'position'"


def _axis_problems(joint: Joint) -> Iterator[str]:
    if joint.kind not in _JOINTS:
        yield f"joint.kind: {_one_of(_JOINTS, joint.kind)}"
    yield from _vector_problems(joint.anchor, "joint.anchor")
    yield from _unit_problems(joint.axis, "joint.axis")
    if joint.kind == "continuous":
        if joint.limit != math.inf:
            yield f"joint.limit: a continuous joint has none, got {shown(joint.limit)}"
    elif not _are_finite((joint.limit,)) or joint.limit <= 0.0:
        yield f"joint.limit: must be finite and > 0, got {shown(joint.limit)}"


def _slot_problems(slot: Slot, at: str) -> Iterator[str]:
    yield from _vector_problems(slot.position, f"{at}.position")
    yield from _unit_problems(slot.normal, f"{at}.normal")
    yield from _unit_problems(slot.tangent, f"{at}.tangent")
    cosine = float(np.dot(slot.normal, slot.tangent))
    if abs(cosine) > _ROUNDING:
        yield (
            f"{at}.tangent: must be at right angles to the normal {slot.normal}, "
            f"got {slot.tangent}"
        )


def _direction_problems(slot: Slot, boxes: Sequence[Box], at: str) -> Iterator[str]:
    """Yield a line if most of the boxes around a slot is in front of it.

    A slot may be sunk into a box, but by less than half. A cylinder counts as the box
    around it.
    """
    ahead = behind = 0.0
    name = ""
    for box in boxes:
        turn = np.array(box.rotation, dtype=np.float64).T
        place = turn @ np.subtract(slot.position, box.position)
        half = np.array(box.size) / 2.0
        if box.segment != slot.segment or np.any(abs(place) > half + _ROUNDING):
            continue
        along = turn @ np.array(slot.normal)
        axes = abs(along) > _ROUNDING
        ends = (np.copysign(half, along) - place)[axes] / along[axes]
        starts = (np.copysign(half, along) + place)[axes] / along[axes]
        if ends.min() > ahead:
            ahead, name = float(ends.min()), box.name
        behind = max(behind, float(starts.min()))
    if ahead > behind + _ROUNDING:
        yield (
            f"{at}.normal: must point out of the part, but {slot.normal} points into "
            f"its box {shown(name)}, {1000 * ahead:.3g} mm deep"
        )


def _box_problems(box: Box, at: str) -> Iterator[str]:
    yield from _vector_problems(box.position, f"{at}.position")
    if not _is_vector(box.size) or min(box.size) <= 0.0:
        yield f"{at}.size: must be 3 finite numbers > 0, got {shown(box.size)}"
    elif box.is_round and box.size[0] != box.size[1]:
        yield f"{at}.size: x and y of a cylinder must be equal, got {shown(box.size)}"
    if not _are_finite((box.mass,)) or box.mass <= 0.0:
        yield f"{at}.mass: must be finite and > 0, got {shown(box.mass)}"
    turn = np.array(box.rotation, dtype=np.float64)
    is_rotation = turn.shape == (3, 3) and np.isfinite(turn).all()
    if not is_rotation or not (
        np.allclose(turn @ turn.T, np.eye(3), rtol=0.0, atol=_ROUNDING)
        and np.linalg.det(turn) > 0.0
    ):
        yield f"{at}.rotation: must be a rotation matrix, got {shown(box.rotation)}"


def _vector_problems(vector: Sequence[float], at: str) -> Iterator[str]:
    if not _is_vector(vector):
        yield f"{at}: must be 3 finite numbers, got {shown(vector)}"


def _unit_problems(vector: Sequence[float], at: str) -> Iterator[str]:
    if not _is_vector(vector):
        yield f"{at}: must be 3 finite numbers, got {shown(vector)}"
    elif abs(math.hypot(*vector) - 1.0) > _ROUNDING:
        yield (
            f"{at}: must have length 1, got {shown(vector)} "
            f"of length {math.hypot(*vector):.6g}"
        )


def _is_vector(vector: Sequence[object]) -> bool:
    return isinstance(vector, tuple) and len(vector) == 3 and _are_finite(vector)  # noqa: PLR2004


def _are_finite(numbers: Sequence[object]) -> bool:
    return all(
        isinstance(each, int | float) and math.isfinite(each) for each in numbers
    )


def _doubled(names: Sequence[str]) -> str:
    """Return a name that occurs twice, or an empty text."""
    return next((name for name in names if names.count(name) > 1), "")


def _one_of(allowed: Sequence[str], got: object) -> str:
    return f"must be one of {', '.join(allowed) or 'none'}, got {shown(got)}"
