"""The tables ``[[calibration]]``: measured sensors and motors, by part type."""

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from math import isclose
from typing import Annotated

from msgspec import Meta

from schema.errors import nearest, shown
from schema.experiment.robust import NoiseLevel
from schema.experiment.section import Number, Section
from schema.parts import PartType


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
    """Yield what is wrong with the part types that the entries name.

    Args:
        entries: the tables.
        types: part types of the experiment, by name.
    """
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


def delay_problems(
    entries: Sequence[Calibration], tick_s: float, *, is_arena: bool
) -> Iterator[str]:
    """Yield what is wrong with the entries on one island.

    Args:
        entries: the tables.
        tick_s: time between brain ticks [s].
        is_arena: whether the island is an arena.
    """
    if entries and is_arena:
        yield "calibration: is for off-line evaluations, not for arenas; remove it"
    for number, entry in enumerate(entries):
        for what in ("sensor", "motor"):
            delay_s = getattr(entry, what).delay_s
            if not isclose(
                round(delay_s / tick_s) * tick_s, delay_s, rel_tol=1e-9, abs_tol=1e-12
            ):
                yield (
                    f"calibration[{number}].{what}.delay_s: must be a whole multiple "
                    f"of {tick_s:g} s, the time between brain ticks, got {delay_s:g}"
                )
