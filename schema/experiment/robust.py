"""Deviations from ideal robots: ``[robust]`` draws, ``[[calibration]]`` measures."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Literal

from msgspec import Meta

from schema.errors import nearest, shown
from schema.experiment.section import (
    NotNegative,
    Number,
    Positive,
    Probability,
    Section,
)
from schema.parts import PartType

MOST_DRAWS = 100
"""Most draws of one evaluation."""
Degrees = Annotated[float, Meta(ge=-180, le=180)]
NoiseLevel = Annotated[float, Meta(ge=0, le=1e6)]
"""A standard deviation; within these bounds no arithmetic overflows."""


class Robust(Section, frozen=True):
    """Evaluation of each robot under several drawn disturbances, off-line.

    A robot is simulated ``draws`` times, each time in a simulation whose numbers are
    drawn from the ranges below, and its fitness is the least, the mean or a quantile of
    the draws. Velocities and measures are means over the draws. If one draw fails, the
    evaluation fails. Each evaluation has a random stream of its own.

    Attributes:
        draws: simulations per evaluation.
        take: ``mean``, ``least`` or ``quantile`` of the fitness of the draws.
        quantile: share of the draws below the quantile; between two draws it is
            interpolated linearly.
        distribution: of each number in its range ``[least, greatest]``: ``uniform``, or
            ``normal`` with the middle as mean, a quarter of the range as standard
            deviation, and values beyond the range moved to its ends.
        friction: factor of ``simulation.friction``.
        mass: factor of ``simulation.mass_factor``: all masses of the robot.
        torque: factor of ``simulation.torque_factor``: greatest torque of all motors.
        lift_m: added to ``simulation.drop_m`` [m].
        tilt_deg: added to roll and to pitch of ``simulation.start_deg`` [degrees]; two
            draws.
        heading_deg: added to yaw of ``simulation.start_deg`` [degrees].
        sensor_noise: added to ``simulation.sensor_noise`` [unit of the reading].
        actuator_noise: added to ``simulation.actuator_noise``.
    """

    draws: Annotated[int, Meta(ge=1, le=MOST_DRAWS)] = 4
    take: Literal["mean", "least", "quantile"] = "mean"
    quantile: Probability = 0.25
    distribution: Literal["uniform", "normal"] = "uniform"
    friction: tuple[NotNegative, NotNegative] = (0.9, 1.1)
    mass: tuple[Positive, Positive] = (0.9, 1.1)
    torque: tuple[Positive, Positive] = (0.9, 1.1)
    lift_m: tuple[NotNegative, NotNegative] = (0.0, 0.001)
    tilt_deg: tuple[Degrees, Degrees] = (-1.0, 1.0)
    heading_deg: tuple[Degrees, Degrees] = (0.0, 0.0)
    sensor_noise: tuple[NoiseLevel, NoiseLevel] = (0.0, 0.05)
    actuator_noise: tuple[NoiseLevel, NoiseLevel] = (0.0, 0.01)


RANGES = Robust.__struct_fields__[4:]
"""Keys that are ranges, in the order of the draws."""


def range_problems(robust: Robust | None) -> Iterator[str]:
    """Yield which range ends before it begins."""
    for name in RANGES if robust is not None else ():
        yield from ordered(f"robust.{name}", getattr(robust, name))


def ordered(key: str, ends: tuple[float, float]) -> Iterator[str]:
    """Yield whether the range of a key ends before it begins."""
    low, high = ends
    if low > high:
        yield f"{key}: must be [least, greatest], got [{low:g}, {high:g}]"


class Response(Section, frozen=True):
    """Measured response of the sensors or of the motor of a part type.

    Attributes:
        gain: factor of the true value.
        offset: added to it after the gain [unit of the value].
        noise: standard deviation, normally distributed [unit of the value].
        delay_s: age of the value; a whole number of brain ticks [s].
    """

    gain: Number = 1.0
    offset: Number = 0.0
    noise: NoiseLevel = 0.0
    delay_s: Annotated[float, Meta(ge=0, le=1000)] = 0.0


IDEAL = Response()
"""Response without a deviation."""


class Calibration(Section, frozen=True):
    """Measured sensors and motor of a part type, off-line.

    A brain receives gain x reading + offset + noise. A motor gets
    gain x (output - 0.5) + 0.5 + offset + noise, where 0 to 1 is the whole range of the
    joint, or of the velocities of a motor that controls velocity; offset and noise are
    shares of this range.

    Attributes:
        part: name of the part type, such as ``ActiveHinge``.
        sensor: response of each of its sensor inputs.
        motor: response of its motor.
    """

    part: str
    sensor: Response = IDEAL
    motor: Response = IDEAL


def calibration_problems(
    entries: Sequence[Calibration], types: Mapping[str, PartType]
) -> Iterator[str]:
    """Yield what is wrong with the part types that the entries name."""
    names = Counter(entry.part for entry in entries)
    for number, entry in enumerate(entries):
        where, name = f"calibration[{number}]", shown(entry.part)
        kind = types.get(entry.part)
        if kind is None:
            near = nearest(entry.part, types)
            yield f"{where}.part: no part type of the experiment is named {name}{near}"
            continue
        if names[entry.part] > 1:
            yield f"{where}.part: two entries are of {name}"
        if entry.sensor != IDEAL and not kind.inputs:
            yield f"{where}.sensor: {name} has no sensor"
        if entry.motor != IDEAL and not kind.outputs:
            yield f"{where}.motor: {name} has no motor"
