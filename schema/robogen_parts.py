"""Part types with RoboGen's own dimensions, from its sources of 2016.

Names, slots, their order and their tangents are those of ``schema.parts``, so that
robots fit both sets; boxes and masses are RoboGen's. The cylinder of the tilting bar
is replaced by its bounding box; servos and the range of the passive hinge are those of
the thesis. An experiment names the types::

    [space]
    part_types = ["schema.robogen_parts:CORE", "schema.robogen_parts:FIXED_BRICK"]

The thesis's part set lacks wheels and the infrared sensor; they go with both sets.

Source: the code of the original, with its wheels, and RoboGen's published sources for
the gaps between boxes and for the infrared sensor.
"""

import math
from dataclasses import dataclass, replace
from typing import Any

from schema import parts
from schema.parts import (
    Box,
    Joint,
    Matrix,
    Motor,
    Parameter,
    PartType,
    Shape,
    Slot,
    Vector,
    cylinder,
)

BAR_KG_PER_M = 0.137
"""Mass of a bar per metre: 1.37 g/cm."""

_CORE = parts.block_shape((0.041, 0.041, 0.0355), 0.0445)
_BRICK = parts.block_shape((0.041, 0.041, 0.0355), 0.0102)
_BASE_SLOT_Z = Slot((-0.00075, 0.0, 0.0), parts.MINUS_X, parts.Z)
_ACTIVE_HINGE = Shape(
    boxes=(
        Box("root", parts.PLATE, (0.0, 0.0, 0.0), 0.002),
        Box("frame", (0.0205, 0.036, 0.013), (0.011, 0.0005, 0.0), 0.001),
        Box("servo", (0.0275, 0.0365, 0.01625), (0.0225, 0.0005, 0.0), 0.013, 1),
        Box("tail", parts.PLATE, (0.037, 0.0, 0.0), 0.002, 1),
    ),
    slots=(_BASE_SLOT_Z, Slot((0.03775, 0.0, 0.0), parts.X, parts.Z, 1)),
    joint=Joint((0.01475, 0.0, 0.0), (0.0, -1.0, 0.0), math.radians(45)),
)
_HINGE = Shape(
    boxes=(
        Box("root", parts.PLATE, (0.0, 0.0, 0.0), 0.002),
        Box("conn_a", (0.0205, 0.002, 0.02), (0.011, 0.0, 0.0), 0.001),
        Box("conn_b", (0.0205, 0.002, 0.02), (0.0275, 0.0, 0.0), 0.001, 1),
        Box("tail", parts.PLATE, (0.0385, 0.0, 0.0), 0.002, 1),
    ),
    slots=(_BASE_SLOT_Z, Slot((0.03925, 0.0, 0.0), parts.X, parts.Z, 1)),
    joint=Joint((0.01925, 0.0, 0.0), parts.Z, math.radians(60)),
)
_TOUCH = Shape(
    boxes=(
        Box("base", parts.PLATE, (0.0, 0.0, 0.0), 0.001),
        Box("left", (0.0085, 0.016, 0.016), (0.005, -0.0085, 0.0), 0.001),
        Box("right", (0.0085, 0.016, 0.016), (0.005, 0.0085, 0.0), 0.001),
    ),
    slots=(parts.BASE_SLOT_Y,),
)
_STUB_M, _CYLINDER_M = 0.006, 0.005
"""Length of the fixed piece of a bar, and radius of the cylinder it tilts about."""


def _bar(values: tuple[float, ...]) -> Shape:
    """Return a bar: plate, stub and cylinder, then bar and tail plate, tilted."""
    length, alpha, beta = values[0] / 1000.0, values[1], values[2]
    sa, ca, sb, cb = math.sin(alpha), math.cos(alpha), math.sin(beta), math.cos(beta)
    tilt: Matrix = ((ca, 0.0, sa), (0.0, 1.0, 0.0), (-sa, 0.0, ca))
    # About x by beta first, then about y by alpha.
    turned: Matrix = ((ca, sa * sb, sa * cb), (0.0, cb, -sb), (-sa, ca * sb, ca * cb))
    pivot = 0.00075 + _STUB_M

    def along(distance: float) -> Vector:
        return (pivot + distance * ca, 0.0, -distance * sa)

    round_off = (2 * _CYLINDER_M, 0.02, 2 * _CYLINDER_M)
    return Shape(
        boxes=(
            Box("root", parts.PLATE, (0.0, 0.0, 0.0), 0.001),
            Box(
                "stub",
                (_STUB_M, 0.02, 0.01),
                (0.00075 + _STUB_M / 2, 0.0, 0.0),
                BAR_KG_PER_M * _STUB_M,
            ),
            # Half of it is inside the stub: its mass is that of the other half.
            Box("cylinder", round_off, (pivot, 0.0, 0.0), BAR_KG_PER_M * _CYLINDER_M),
            Box(
                "bar",
                (length, 0.02, 0.01),
                along(length / 2),
                BAR_KG_PER_M * length,
                0,
                tilt,
            ),
            Box("tail", parts.PLATE, along(length + 0.00075), 0.001, 0, turned),
        ),
        slots=(
            parts.BASE_SLOT_Y,
            Slot(along(length + 0.0015), (ca, 0.0, -sa), (sa * sb, cb, ca * sb)),
        ),
    )


CORE = replace(parts.CORE, shape=parts.constant_shape(_CORE))
FIXED_BRICK = replace(parts.FIXED_BRICK, shape=parts.constant_shape(_BRICK))
ACTIVE_HINGE = replace(parts.ACTIVE_HINGE, shape=parts.constant_shape(_ACTIVE_HINGE))
HINGE = replace(parts.HINGE, shape=parts.constant_shape(_HINGE))
PARAMETRIC_BAR_JOINT = replace(parts.PARAMETRIC_BAR_JOINT, shape=_bar)
TOUCH_SENSOR = replace(parts.TOUCH_SENSOR, shape=parts.constant_shape(_TOUCH))
LIGHT_SENSOR = parts.LIGHT_SENSOR

IR_RANGE_M = 0.5
"""Range of the infrared sensor [m]; RoboGen's is 0.255 m."""
_WHEEL_M = 0.003
"""Thickness of wheels [m]."""
_MINUS_Z: Vector = (0.0, 0.0, -1.0)
_RADIUS = Parameter("radius", 40.0, 80.0, 60.0, unit="mm")
"""As the lengths in the genome of the original."""
WHEEL_MOTOR = Motor(gain=0.0, max_torque=0.3924, max_velocity=5.236, control="velocity")
"""4 kg cm, 50 rpm; outputs from 0 to 1 command -50 to 50 rpm."""


def _wheel(values: tuple[float, ...]) -> Shape:
    """Return a free wheel: a block, and a disc that turns about it."""
    size = (0.034, 0.034, 0.01075)
    centre = (0.0, 0.0, 0.000625)
    radius = values[0] / 1000.0
    return Shape(
        boxes=(
            Box("block", size, (0.0, 0.0, 0.0), 0.0025),
            cylinder("wheel", radius, _WHEEL_M, centre, 0.004, segment=1),
        ),
        slots=(Slot((0.0, 0.0, -0.005375), _MINUS_Z, parts.Y),),
        joint=Joint(centre, _MINUS_Z, kind="continuous"),
    )


def _active_wheel(values: tuple[float, ...]) -> Shape:
    """Return a driven wheel: a plate, a servo, and a disc at its end."""
    plate, servo = (0.034, 0.034, 0.0015), (0.014, 0.014, 0.0338)
    end = (0.0, 0.0, 0.0333)
    radius = values[0] / 1000.0
    return Shape(
        boxes=(
            Box("plate", plate, (0.0, 0.0, 0.0), 0.004),
            Box("servo", servo, (0.0, 0.0, 0.0164), 0.009),
            cylinder("wheel", radius, _WHEEL_M, end, 0.005, segment=1),
        ),
        slots=(Slot((0.0, 0.0, -0.00075), _MINUS_Z, parts.Y),),
        joint=Joint(end, _MINUS_Z, kind="continuous"),
    )


@dataclass(frozen=True, slots=True)
class Infrared:
    """Sensor that measures how near the first obstacle ahead of a box is.

    It gives 1 - distance / range: 0 if nothing is within range, 1 at the sensor.

    Attributes:
        box: that sends the ray, along its x axis.
        start: of the ray, in the frame of the box [m].
        range_m: [m].
        inputs: number of network inputs.
    """

    box: str
    start: Vector
    range_m: float = IR_RANGE_M
    inputs: int = 1

    def read(self, view: Any, /) -> tuple[float]:  # noqa: ANN401 - a SensorView
        """Return the nearness of the first obstacle."""
        distance = view.distance(self.box, parts.X, self.range_m, self.start)
        return (1.0 - distance / self.range_m,)


_INFRARED = Shape(
    boxes=(
        Box("base", parts.PLATE, (0.0, 0.0, 0.0), 0.001),
        Box("platform", (0.0055, 0.0233, 0.023), (0.0035, 0.0, 0.0), 0.001),
    ),
    slots=(parts.BASE_SLOT_Y,),
)
WHEEL = PartType("Wheel", 1, _wheel, own_parameters=(_RADIUS,))
ACTIVE_WHEEL = PartType(
    "ActiveWheel", 1, _active_wheel, own_parameters=(_RADIUS,), motor=WHEEL_MOTOR
)
IR_SENSOR = PartType(
    "IrSensor",
    1,
    parts.constant_shape(_INFRARED),
    # RoboGen's ray starts 6 mm from the centre of the base.
    sensors=(Infrared("platform", (0.0025, 0.0, 0.0)),),
)
