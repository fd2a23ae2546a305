"""Check of own sensors, on hand-made views."""

import math
from collections.abc import Iterable
from dataclasses import dataclass, replace
from functools import partial
from typing import SupportsFloat

import numpy as np

from schema.errors import ExperimentError, cut, error_text, shown
from schema.parts import Box, OwnSensor, Shape, Vector
from schema.plugins.contract import broken, repeated
from schema.robot.trace import Floats

MOST_INPUTS = 1000
"""Most inputs of one sensor."""


@dataclass(frozen=True, slots=True)
class HandMadeView:
    """View of a part at the origin, upright, joint at an angle; a ``SensorView``.

    Attributes:
        shape: of the part; None for one that has any box, and a joint.
        age_s, joint_angle, joint_speed, light, others: as in the protocol.
        obstacle_m: distance of what all rays meet [m].
        is_touched: whether all boxes touch something.
    """

    shape: Shape | None
    age_s: float
    joint_angle: float
    joint_speed: float
    light: Vector | None
    others: Floats
    obstacle_m: float
    is_touched: bool

    def position(self, box: str) -> Floats:
        """Return the centre of a box in the part's frame."""
        return np.array(self._box(box).position, dtype=np.float64)

    def rotation(self, box: str) -> Floats:
        """Return the rotation of a box in the part's frame."""
        return np.array(self._box(box).rotation, dtype=np.float64)

    def touches(self, box: str) -> bool:
        """Return whether anything is touched."""
        self._box(box)
        return self.is_touched

    def distance(
        self, box: str, direction: Vector, reach: float, start: Vector = (0.0, 0.0, 0.0)
    ) -> float:
        """Return the distance of the obstacle, or ``reach``."""
        self._box(box)
        ray_problem(direction, reach, start)
        return min(self.obstacle_m, reach)

    def _box(self, name: str) -> Box:
        if self.shape is None:
            return Box(name, (0.1, 0.1, 0.1), (0.0, 0.0, 0.0), 0.1)
        return {box.name: box for box in self.shape.boxes}[name]


def ray_problem(direction: Vector, reach: float, start: Vector) -> None:
    """Raise ValueError unless a sensor's ray is well defined."""
    # A length that is not a number is not close to 1.
    if not math.isclose(math.hypot(*direction), 1.0, rel_tol=0.0, abs_tol=1e-6):
        raise ValueError(f"direction must have length 1, got {direction}")
    if not (math.isfinite(reach) and reach > 0.0):
        raise ValueError(f"reach must be finite and > 0, got {reach}")
    if not all(map(math.isfinite, start)):
        raise ValueError(f"start must be finite, got {start}")


def check_sensor(sensor: OwnSensor, shape: Shape | None = None) -> None:
    """Raise unless an own sensor keeps its contract on three hand-made views.

    The views: at birth with nothing around; later, in touch, with a light and two other
    robots; and alone with an obstacle at hand.

    Without a shape of its part, any name of a box is allowed.

    Raises:
        ExperimentError: no whole number of inputs, or a ``read`` that raises or
            does not return as many finite numbers, equal for one view.
    """
    name = type(sensor).__name__
    inputs = getattr(sensor, "inputs", None)
    if type(inputs) is not int or not 1 <= inputs <= MOST_INPUTS:
        raise broken(f"{name}.inputs", f"be a whole number from 1 to {MOST_INPUTS}",
                     inputs)  # fmt: skip
    if not callable(getattr(sensor, "read", None)):
        raise broken(name, "have a method read(view)", came="none")

    for place, view in _views(shape).items():
        repeated(name, partial(_read, sensor, view, place), (view.others,))


def _read(sensor: OwnSensor, view: HandMadeView, place: str) -> list[float]:
    """Return the values of a sensor; its errors tell what the view shows."""
    try:
        return values_of(sensor.inputs, sensor.read(view))
    except Exception as error:
        # A ValueError of ``values_of`` says what was expected.
        what = f"{type(sensor).__name__}.read of a part {place}"
        raise ExperimentError(f"{what}: {cut(error_text(error))}") from error


def values_of(inputs: int, values: Iterable[object]) -> list[float]:
    """Return the values that a sensor has read as plain floats.

    Raises:
        ValueError: another number of values, or one that is not a finite number.
    """
    try:
        numbers = [_number(value) for value in values]
    except TypeError:
        raise ValueError(f"must return numbers, got {shown(values)}") from None
    if len(numbers) != inputs:
        raise ValueError(f"must return {inputs} values, its inputs, got {len(numbers)}")
    if not all(map(math.isfinite, numbers)):
        raise ValueError(f"must return finite numbers, got {shown(numbers)}")
    return numbers


def _number(value: object) -> float:
    if isinstance(value, SupportsFloat):  # a text is none
        return float(value)
    raise TypeError


def _views(shape: Shape | None) -> dict[str, HandMadeView]:
    speed, angle = 0.5, 0.1
    if shape is not None:
        speed = 0.0 if shape.joint is None else speed
        angle = 0.0 if shape.joint is None else min(angle, shape.joint.limit)
    alone, crowd = np.zeros((0, 3)), np.array([(0.3, 0.0, 0.0), (-1.0, 2.0, 0.1)])
    inf, lamp = math.inf, (0.0, 0.0, 1.0)
    born = HandMadeView(shape, 0.0, 0.0, 0.0, None, alone, inf, is_touched=False)
    later = HandMadeView(shape, 12.5, angle, speed, lamp, crowd, 0.3, is_touched=True)
    near = replace(born, age_s=60.0, joint_angle=-angle, joint_speed=-speed)
    return {
        "at birth": born,
        "in a crowd": later,
        "at an obstacle": replace(near, obstacle_m=1e-3),
    }
