"""Checks of the slots and sensors of consistent part types, before a run."""

import math
from collections.abc import Sequence

import numpy as np

from schema.errors import shown
from schema.parts import Box, PartType, Sensor, Slot
from schema.plugins.contract import broken
from schema.plugins.part_checks import ROUNDING, extremes
from schema.robot.trace import Floats

_OFF_SURFACE_M = 0.001
"""Distance of a slot from the surface above which it gets a warning."""


def check_slots_and_sensors(kind: PartType) -> None:
    """Raise unless a model can hold the sensors and slots of a consistent part type.

    It is not part of ``check_part_type``: finished runs may have such parts.

    Raises:
        ExperimentError: a slot that points into its own part, imus on two boxes, or a
            touch sensor of a box whose name MJCF cannot hold.
    """
    for values in extremes(kind):
        shape = kind.shape(values)
        for number, slot in enumerate(shape.slots):
            _check_direction(slot, shape.boxes, f"slots[{number}].normal")
    sensors = [sensor for sensor in kind.sensors if isinstance(sensor, Sensor)]
    imus = sorted({sensor.box for sensor in sensors if sensor.kind == "imu"})
    if len(imus) > 1:
        raise broken("sensors", "have imus on one box only", imus)
    for sensor in sensors:
        if sensor.kind == "touch" and "/" in sensor.box:
            rule = "have no '/' in the name of a box with a touch sensor"
            raise broken("boxes", rule, sensor.box)


def advise_shape(kind: PartType) -> str:
    """Return a warning about the shape of a consistent part type, or nothing.

    It is about a slot that is not on the part's surface, or a joint that turns further
    than once: its limit may be in degrees.
    """
    for values in extremes(kind):
        shape = kind.shape(values)
        joint = shape.joint
        if joint and joint.kind == "revolute" and math.tau < joint.limit < math.inf:
            turned = f"{joint.limit:g} degrees are {math.radians(joint.limit):.3g} rad"
            return f"joint.limit is {joint.limit:g} rad, more than a turn: {turned}"
        for number, slot in enumerate(shape.slots):
            away_m = _distance_from_surface(slot, shape.boxes)
            if away_m > _OFF_SURFACE_M:
                place = f"slots[{number}].position is {1000 * away_m:.3g} mm"
                boxes = f"the surface of the boxes of segment {slot.segment}"
                return f"{place} from {boxes}: attached parts float or sink by as much"
    return ""


def _in_box(box: Box, slot: Slot) -> tuple[Floats, Floats]:
    turn = np.array(box.rotation, dtype=np.float64).T
    return turn @ np.subtract(slot.position, box.position), turn @ np.array(slot.normal)


def _distance_from_surface(slot: Slot, boxes: Sequence[Box]) -> float:
    """Return how far a slot is from the nearest surface of its segment's boxes [m].

    Within a box its nearest face counts, hidden or not. 0 if the segment has no box. A
    cylinder counts as the box around it.
    """
    outside, inside = math.inf, 0.0
    for box in boxes:
        if box.segment == slot.segment:
            beyond = abs(_in_box(box, slot)[0]) - np.array(box.size) / 2.0
            outside = min(outside, float(np.linalg.norm(np.maximum(beyond, 0.0))))
            inside = max(inside, -float(beyond.max()))
    return outside if 0.0 < outside < math.inf else inside


def _check_direction(slot: Slot, boxes: Sequence[Box], at: str) -> None:
    """Raise if most of the boxes around a slot is in front of it.

    A slot may be sunk into a box, but by less than half. A cylinder counts as the box
    around it.
    """
    ahead = behind = 0.0
    name = ""
    for box in boxes:
        place, along = _in_box(box, slot)
        half = np.array(box.size) / 2.0
        if box.segment != slot.segment or np.any(abs(place) > half + ROUNDING):
            continue
        axes = abs(along) > ROUNDING
        ends = (np.copysign(half, along) - place)[axes] / along[axes]
        starts = (np.copysign(half, along) + place)[axes] / along[axes]
        if ends.min() > ahead:
            ahead, name = float(ends.min()), box.name
        behind = max(behind, float(starts.min()))
    if ahead > behind + ROUNDING:
        depth = f"its box {shown(name)}, {1000 * ahead:.3g} mm deep"
        raise broken(at, "point out of the part", came=f"{slot.normal} into {depth}")
