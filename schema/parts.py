"""Part types as data: the RoboGen body space as changed by Revolve.

Lengths are in metres, masses in kilograms, angles in radians. The frame of a part has
its origin at the centre of its root box.

Source: Hupkes, *Revolve*, 2016, table 5.1, and its published code. Where they differ,
these types follow the code, which produced the results.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from typing import Annotated, Any, Literal, Protocol

from msgspec import Meta, Struct

from schema.limits import Finite, PositiveFinite

Vector = tuple[Finite, Finite, Finite]
Matrix = tuple[Vector, Vector, Vector]

IDENTITY: Matrix = ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))
BAR_KG_PER_M = 0.02
"""Mass of a bar per metre: 0.2 g/cm as coded; the author meant 2 g/cm."""


class Box(Struct, frozen=True):
    """Box or cylinder of a part, of uniform density; it collides.

    Attributes:
        name: unique within the part.
        size: full lengths along its own x, y, z [m]; of a cylinder, its diameter
            twice, and its length.
        position: centre in the part frame [m].
        mass: [kg].
        segment: 0 on the side of slot 0, 1 beyond the joint.
        rotation: box frame to part frame, rows first.
        is_round: it is a cylinder about its own z axis; see ``cylinder``.
    """

    name: str
    size: tuple[PositiveFinite, PositiveFinite, PositiveFinite]
    position: Vector
    mass: PositiveFinite
    segment: int = 0
    rotation: Matrix = IDENTITY
    is_round: bool = False


def cylinder(
    name: str,
    radius: float,
    length: float,
    position: Vector,
    mass: float,
    *,
    segment: int = 0,
    rotation: Matrix = IDENTITY,
) -> Box:
    """Return a cylinder about its own z axis, for the boxes of a shape.

    Args:
        name: unique within the part.
        radius: [m].
        length: along the axis [m].
        position: centre in the part frame [m].
        mass: [kg].
        segment: 0 on the side of slot 0, 1 beyond the joint.
        rotation: cylinder frame to part frame, rows first; the default is an axis
            along the part's z.
    """
    size = (2.0 * radius, 2.0 * radius, length)
    return Box(name, size, position, mass, segment, rotation, is_round=True)


class Slot(Struct, frozen=True, cache_hash=True):
    """Attachment place of a part: position [m], outward normal, tangent."""

    position: Vector
    normal: Vector
    tangent: Vector
    segment: int = 0


class Joint(Struct, frozen=True):
    """Joint between the two segments of a part.

    A ``revolute`` joint turns within a limit, a ``continuous`` one turns freely, as
    a wheel does, and a ``prismatic`` one slides within a limit.

    Attributes:
        anchor: a point of the axis in the part frame [m].
        axis: a positive angle rotates segment 1 about it relative to segment 0; a
            positive displacement moves segment 1 along it.
        limit: greatest absolute angle [rad] or displacement [m]; infinite if
            continuous.
        kind: of the joint, as in URDF.
    """

    anchor: Vector
    axis: Vector
    limit: Annotated[float, Meta(gt=0)] = math.inf
    kind: Literal["revolute", "continuous", "prismatic"] = "revolute"


@dataclass(frozen=True, slots=True)
class Motor:
    """Servo that commands a velocity and holds it between brain ticks.

    The network output runs over [0, 1]. Control of ``position``: commanded velocity =
    gain * (target - angle), where target runs over the joint's range. Control of
    ``velocity``: the commanded velocity runs from -max_velocity to max_velocity.

    Attributes:
        gain: of a position control [1/s].
        max_torque: greatest torque [N m]; of a slider, force [N].
        max_velocity: greatest commanded velocity [rad/s]; of a slider [m/s].
        control: ``position`` or ``velocity``; a continuous joint needs ``velocity``.
    """

    gain: Finite
    max_torque: PositiveFinite
    max_velocity: PositiveFinite
    control: Literal["position", "velocity"] = "position"


@dataclass(frozen=True)
class Sensor:
    """Built-in sensor: ``imu`` gives 6 inputs, ``touch`` and ``light`` one each.

    Attributes:
        kind: what it measures.
        box: name of the box that holds it (imu, light) or that it senses (touch).
    """

    kind: Literal["imu", "touch", "light"]
    box: str

    @cached_property
    def inputs(self) -> int:
        """Number of network inputs."""
        return 6 if self.kind == "imu" else 1


class OwnSensor(Protocol):
    """Sensor of a plug-in; ``schema.plugins.protocols.SensorType`` explains it."""

    @property
    def inputs(self) -> int:
        """Number of network inputs."""

    def read(self, view: Any, /) -> Sequence[float]:  # noqa: ANN401 - a SensorView
        """Return the values of the inputs."""


@dataclass(frozen=True, slots=True)
class Parameter:
    """Parameter of a part or neuron, drawn uniformly from [low, high].

    Parameters that are not mutable (colours) keep their inherited value. The unit is
    for display; values are not converted.
    """

    name: str
    low: Finite
    high: Finite
    default: Finite
    is_mutable: bool = True
    unit: str = ""

    def text(self, value: float) -> str:
        """Return name, value and unit, for example ``alpha 0.5 rad``."""
        return f"{self.name} {value:g} {self.unit}".rstrip()


class Shape(Struct, frozen=True, cache_hash=True):
    """Geometry of a part for given parameters; ``joint`` is None if rigid."""

    boxes: tuple[Box, ...]
    slots: tuple[Slot, ...]
    joint: Joint | None = None


COLOURS = tuple(
    Parameter(name, 0.0, 1.0, 0.5, is_mutable=False)
    for name in ("red", "green", "blue")
)


@dataclass(frozen=True, slots=True)
class PartType:
    """Type of parts.

    Attributes:
        name: used in genomes, files and tables.
        arity: number of slots.
        shape: maps parameter values, in the order of ``parameters``, to geometry.
        own_parameters: parameters before the three colours.
        sensors: built-in or own, in the order of their inputs.
        motor: drives the joint by one network output; None for no motor.
        is_root: it is a core, which is always and only the root of a tree.
        is_levelled: in planar bodies it is rotated into the plane of the core.
        not_on: names of part types that random growth never attaches it to.
        parameters: all parameters, colours last.
        inputs: number of network inputs of its sensors.
        outputs: number of network outputs of its motor.
    """

    name: str
    arity: int
    shape: Callable[[tuple[float, ...]], Shape]
    own_parameters: tuple[Parameter, ...] = ()
    sensors: tuple[Sensor | OwnSensor, ...] = ()
    motor: Motor | None = None
    is_root: bool = False
    is_levelled: bool = False
    not_on: tuple[str, ...] = ()

    parameters: tuple[Parameter, ...] = field(init=False)
    inputs: int = field(init=False)
    outputs: int = field(init=False)

    def __post_init__(self) -> None:
        """Derive the attributes that each birth uses."""
        inputs = sum(sensor.inputs for sensor in self.sensors)
        object.__setattr__(self, "parameters", self.own_parameters + COLOURS)
        object.__setattr__(self, "inputs", inputs)
        object.__setattr__(self, "outputs", 0 if self.motor is None else 1)


BodySpace = Mapping[str, PartType]
"""Allowed part types by name, in a fixed order."""

PLATE: Vector = (0.0015, 0.034, 0.034)
X: Vector = (1.0, 0.0, 0.0)
Y: Vector = (0.0, 1.0, 0.0)
Z: Vector = (0.0, 0.0, 1.0)
MINUS_X: Vector = (-1.0, 0.0, 0.0)
MINUS_Y: Vector = (0.0, -1.0, 0.0)
BASE_SLOT_Y = Slot((-0.00075, 0.0, 0.0), MINUS_X, Y)

SERVO = Motor(gain=0.9, max_torque=0.17658, max_velocity=5.236)
"""1.8 kg cm, 50 rpm; the gain is that of the thesis, much lower than RoboGen's."""


def block_shape(size: Vector, mass: float) -> Shape:
    """Return a box, x and y equal [m], [kg], with slots front, back, right and left."""
    reach = 0.5 * size[0]
    slots = (
        Slot((0.0, -reach, 0.0), MINUS_Y, Z),
        Slot((0.0, reach, 0.0), Y, Z),
        Slot((reach, 0.0, 0.0), X, Z),
        Slot((-reach, 0.0, 0.0), MINUS_X, Z),
    )
    return Shape((Box("body", size, (0.0, 0.0, 0.0), mass),), slots)


_CORE = block_shape((0.09, 0.09, 0.045), 0.09)
_BRICK = block_shape((0.041, 0.041, 0.0355), 0.0102)
_ACTIVE_HINGE = Shape(
    boxes=(
        Box("root", PLATE, (0.0, 0.0, 0.0), 0.007),
        Box("frame", (0.018, 0.034, 0.01), (0.00985, 0.0, 0.0), 0.0012),
        Box("servo", (0.0245, 0.034, 0.01), (0.0231, 0.0, 0.0), 0.009, 1),
        Box("tail", PLATE, (0.0362, 0.0, 0.0), 0.007, 1),
    ),
    slots=(Slot((-0.00075, 0.0, 0.0), MINUS_X, Z), Slot((0.03695, 0.0, 0.0), X, Z, 1)),
    joint=Joint((0.01485, 0.0, 0.0), MINUS_Y, math.radians(45)),
)
_HINGE = Shape(
    boxes=(
        Box("root", PLATE, (0.0, 0.0, 0.0), 0.002),
        Box("conn_a", (0.0205, 0.002, 0.02), (0.0111, 0.0, 0.0), 0.001),
        Box("conn_b", (0.0205, 0.002, 0.02), (0.0276, 0.0, 0.0), 0.001, 1),
        Box("tail", PLATE, (0.0387, 0.0, 0.0), 0.002, 1),
    ),
    slots=(Slot((-0.00075, 0.0, 0.0), MINUS_X, Z), Slot((0.03945, 0.0, 0.0), X, Z, 1)),
    joint=Joint((0.01935, 0.0, 0.0), Z, math.radians(60)),
)
_TOUCH = Shape(
    boxes=(
        Box("base", PLATE, (0.0, 0.0, 0.0), 0.003),
        Box("left", (0.009, 0.0185, 0.016), (0.00525, -0.01025, 0.0), 0.003),
        Box("right", (0.009, 0.0185, 0.016), (0.00525, 0.01025, 0.0), 0.003),
    ),
    slots=(BASE_SLOT_Y,),
)
_LIGHT = Shape(
    boxes=(Box("base", PLATE, (0.0, 0.0, 0.0), 0.002),), slots=(BASE_SLOT_Y,)
)


def _bar(values: tuple[float, ...]) -> Shape:
    """Return a bar: a plate, a strip and a tail plate tilted by alpha, beta.

    The length is in millimetres, as in the genome of the original.
    """
    length, alpha, beta = values[0] / 1000.0, values[1], values[2]
    sa, ca, sb, cb = math.sin(alpha), math.cos(alpha), math.sin(beta), math.cos(beta)
    # Rotation about x by beta first, then about y by alpha.
    tilt: Matrix = ((ca, sa * sb, sa * cb), (0.0, cb, -sb), (-sa, ca * sb, ca * cb))
    tail = length + 0.0015
    normal, tangent = (ca, 0.0, -sa), (sa * sb, cb, ca * sb)
    end = (tail + 0.00075 * ca, 0.0, -0.00075 * sa)
    return Shape(
        boxes=(
            Box("root", PLATE, (0.0, 0.0, 0.0), 0.001),
            Box(
                "bar",
                (length, 0.02, 0.002),
                (0.00075 + length / 2, 0.0, 0.0),
                BAR_KG_PER_M * length,
            ),
            Box("tail", PLATE, (tail, 0.0, 0.0), 0.001, 0, tilt),
        ),
        slots=(BASE_SLOT_Y, Slot(end, normal, tangent)),
    )


def constant_shape(shape: Shape) -> Callable[[tuple[float, ...]], Shape]:
    """Return a function that returns a shape for any parameters."""
    return lambda _values: shape


CORE = PartType(
    "Core", 4, constant_shape(_CORE), sensors=(Sensor("imu", "body"),), is_root=True
)
FIXED_BRICK = PartType("FixedBrick", 4, constant_shape(_BRICK), is_levelled=True)
ACTIVE_HINGE = PartType("ActiveHinge", 2, constant_shape(_ACTIVE_HINGE), motor=SERVO)
HINGE = PartType("Hinge", 2, constant_shape(_HINGE))
PARAMETRIC_BAR_JOINT = PartType(
    "ParametricBarJoint",
    2,
    _bar,
    own_parameters=(
        Parameter("connection_length", 20.0, 100.0, 50.0, unit="mm"),
        Parameter("alpha", -math.pi / 2, math.pi / 2, 0.0, unit="rad"),
        # Planar bodies, the default, have beta 0.
        Parameter("beta", 0.0, 0.0, 0.0, unit="rad"),
    ),
    is_levelled=True,
    not_on=("ParametricBarJoint",),
)
TOUCH_SENSOR = PartType(
    "TouchSensor",
    1,
    constant_shape(_TOUCH),
    sensors=(Sensor("touch", "left"), Sensor("touch", "right")),
)
LIGHT_SENSOR = PartType(
    "LightSensor", 1, constant_shape(_LIGHT), sensors=(Sensor("light", "base"),)
)

BUILT_IN: BodySpace = {
    part_type.name: part_type
    for part_type in (
        CORE,
        FIXED_BRICK,
        ACTIVE_HINGE,
        HINGE,
        PARAMETRIC_BAR_JOINT,
        TOUCH_SENSOR,
        LIGHT_SENSOR,
    )
}
"""The part set T of the thesis, table 5.1, and its light sensor."""
