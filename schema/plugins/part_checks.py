"""Checks of part types, built-in or own, when an experiment is loaded."""

import math
from collections.abc import Iterator, Sequence
from itertools import product
from typing import Literal, get_args, get_origin, get_type_hints

import numpy as np
from msgspec import convert, to_builtins

from schema.errors import ExperimentError, cut, error_text, expectation, naming, shown
from schema.parts import Box, Joint, Motor, PartType, Sensor, Shape, Slot
from schema.plugins.contract import broken, repeated
from schema.plugins.origin import naming_plugin
from schema.plugins.sensor_checks import check_sensor

ROUNDING = 1e-6
"""Greatest deviation of a length from 1, and of a cosine from 0."""
_UNIT_VECTORS = {"axis", "normal", "tangent"}
_MOST_TOGETHER = 8
"""Most parameters of which all combinations of extreme values are tried."""


def check_part_type(kind: PartType, where: str = "part type") -> None:
    """Raise unless a part type is consistent, with all extreme parameters.

    Shapes are made twice for each combination of lowest and highest values; with more
    than 8 parameters, for each extreme value alone. Own sensors read hand-made views.

    Raises:
        ExperimentError: a piece that is not what it must be; a shape that raises,
            differs from call to call, or is not hashable.
    """
    name = f"part type {shown(kind.name)}"
    with naming_plugin(where, kind.shape), naming(name, ExperimentError):
        _check_consistency(kind)


def _check_consistency(kind: PartType) -> None:
    _check_declaration(kind)
    for values in extremes(kind):
        try:
            _check_shape(kind, values)
        except ExperimentError as error:
            raise ExperimentError(f"{error}{_given(kind, values)}") from error
    shape = kind.shape(_default(kind))
    for number, sensor in enumerate(kind.sensors):
        if not isinstance(sensor, Sensor):
            with naming_plugin(f"sensors[{number}]", sensor):
                check_sensor(sensor, shape)


def _check_types(piece: object, at: str) -> None:
    """Raise unless each attribute of a piece of a part is of its type and in range."""
    kinds = get_type_hints(type(piece))
    try:
        convert(to_builtins(piece, enc_hook=float), type(piece))
    except (TypeError, ValueError) as error:
        # NumPy's numbers count as numbers; of others the hook raises, without a place.
        message, _, path = str(error).partition(" - at `$.")
        path = path.rstrip("`")
        name = path.partition("[")[0]
        rule = expectation(message).partition(", got ")[0].removeprefix("must ")
        if get_origin(kinds.get(name)) is Literal:
            rule = f"be one of {', '.join(get_args(kinds[name]))}"
        value = getattr(piece, name, piece)
        raise broken(f"{at}.{path}" if path else at, rule, value) from None
    for name in _UNIT_VECTORS & kinds.keys():
        if abs(math.hypot(*getattr(piece, name)) - 1.0) > ROUNDING:
            raise broken(f"{at}.{name}", "be of length 1", getattr(piece, name))


def _check_declaration(kind: PartType) -> None:
    """Raise for what is wrong with a part type whatever its shape."""
    if not kind.name.strip():
        raise broken("name", "not be empty", kind.name)
    if kind.arity < 1:
        raise broken("arity", "be a whole number >= 1", kind.arity)
    for number, parameter in enumerate(kind.own_parameters):
        at = f"own_parameters[{number}] ({parameter.name})"
        _check_types(parameter, at)
        ends = parameter.low, parameter.default, parameter.high
        if list(ends) != sorted(ends):
            raise broken(at, "have low <= default <= high", ends)
    _check_names("own_parameters", [parameter.name for parameter in kind.parameters])
    if kind.motor is not None:
        _check_types(kind.motor, "motor")
        if kind.motor.control == "position" and kind.motor.gain <= 0.0:
            raise broken("motor.gain", "be > 0", kind.motor.gain)
    for number, sensor in enumerate(kind.sensors):
        if isinstance(sensor, Sensor):
            _check_types(sensor, f"sensors[{number}]")


def _shape(kind: PartType, values: tuple[float, ...]) -> Shape:
    """Return the shape of some parameters, made twice."""
    try:
        shape = repeated("shape", lambda: kind.shape(values))
    except ExperimentError:
        raise
    except Exception as error:
        raise ExperimentError(f"shape raised {cut(error_text(error))}") from error
    if not isinstance(shape, Shape):
        raise broken("shape", "return a Shape", shape)
    try:
        hash(shape)
    except TypeError as error:
        rule = "hold tuples and numbers only"
        raise broken("shape", rule, came=f"an {error}") from error
    return shape


def _check_shape(kind: PartType, values: tuple[float, ...]) -> None:
    shape = _shape(kind, values)
    _check_slots(kind, shape.slots)
    names = [box.name for box in shape.boxes]
    _check_names("boxes", names)
    for number, box in enumerate(shape.boxes):
        at = f"boxes[{number}] ({box.name})"
        _check_types(box, at)
        turn = np.array(box.rotation)
        is_turn = np.allclose(turn @ turn.T, np.eye(3), rtol=0.0, atol=ROUNDING)
        if not (is_turn and np.linalg.det(turn) > 0.0):
            raise broken(f"{at}.rotation", "be a rotation matrix", box.rotation)
        if box.is_round and box.size[0] != box.size[1]:
            raise broken(f"{at}.size", "have equal x and y in a cylinder", box.size)
    for number, sensor in enumerate(kind.sensors):
        if isinstance(sensor, Sensor) and sensor.box not in names:
            rule = f"be one of {', '.join(names) or 'none'}"
            raise broken(f"sensors[{number}].box", rule, sensor.box)
    _check_segments(kind, shape)
    if shape.joint is not None:
        _check_joint(shape.joint, kind.motor)
    elif kind.motor is not None:
        raise broken("motor", "have a joint", came="a shape without one")


def _check_slots(kind: PartType, slots: Sequence[Slot]) -> None:
    if len(slots) != kind.arity:
        raise broken("slots", f"be {kind.arity}, the arity", len(slots))
    for number, slot in enumerate(slots):
        at = f"slots[{number}]"
        _check_types(slot, at)
        if abs(float(np.dot(slot.normal, slot.tangent))) > ROUNDING:
            rule = f"be at right angles to the normal {slot.normal}"
            raise broken(f"{at}.tangent", rule, slot.tangent)


def _check_segments(kind: PartType, shape: Shape) -> None:
    """Raise for a segment that must not be there, or that has no box."""
    allowed, how = ((0,), "without") if shape.joint is None else ((0, 1), "with")
    pieces: list[Box | Slot] = [*shape.boxes, *shape.slots]
    for piece in pieces:
        if piece.segment not in allowed:
            rule = f"be {' or '.join(map(str, allowed))} {how} a joint"
            raise broken("segment", rule, piece.segment)
    for segment in allowed if shape.joint is not None or kind.is_root else ():
        if all(box.segment != segment for box in shape.boxes):
            rule = f"have at least one in segment {segment}"
            raise broken("boxes", rule, came="none")


def _check_joint(joint: Joint, motor: Motor | None) -> None:
    _check_types(joint, "joint")
    is_continuous = joint.kind == "continuous"
    if is_continuous != (joint.limit == math.inf):
        rule = "be infinite if continuous" if is_continuous else "be finite and > 0"
        raise broken("joint.limit", rule, joint.limit)
    if is_continuous and motor is not None and motor.control != "velocity":
        rule = "be 'velocity' for a continuous joint"
        raise broken("motor.control", rule, motor.control)


def _check_names(at: str, names: Sequence[str]) -> None:
    """Raise if a name occurs twice."""
    for name in names:
        if names.count(name) > 1:
            raise broken(at, "have different names", came=f"two named {shown(name)}")


def _default(kind: PartType) -> tuple[float, ...]:
    return tuple(parameter.default for parameter in kind.parameters)


def extremes(kind: PartType) -> Iterator[tuple[float, ...]]:
    """Yield the default parameters, then combinations of extreme ones."""
    default, count = _default(kind), len(kind.own_parameters)
    yield default
    ends = [sorted({p.low, p.high}) for p in kind.own_parameters]
    if 0 < count <= _MOST_TOGETHER:
        for corner in product(*ends):
            yield (*corner, *default[count:])
    elif count:
        for index, values in enumerate(ends):
            for value in values:
                yield (*default[:index], value, *default[index + 1 :])


def _given(kind: PartType, values: tuple[float, ...]) -> str:
    """Return the end of a message that names own parameters; empty without them."""
    given = zip(kind.own_parameters, values, strict=False)
    text = ", ".join(f"{parameter.name} = {value:g}" for parameter, value in given)
    return f" (with {text}, then three colours)" if text else ""
