"""Tasks: fitness functions with parameters, beside the thesis's locomotion.

Each takes a trace and its own parameters, which are the table ``[fitness.parameters]``
of an experiment, and returns a finite number, higher is better. A value above a
``limit`` comes from broken physics and counts as 0, as in the thesis. docs/tasks.md
shows each task and an experiment for it.
"""

from itertools import pairwise, starmap
from math import atan2, cos, hypot, radians, sin, sqrt
from typing import Annotated, Literal

from msgspec import Meta, Struct

from schema.errors import ExperimentError
from schema.experiment.section import Angle, Coordinate, Extent, Limit, NotNegative
from schema.robot.trace import Floats, Trace, needs, sum_in_order

_Place = tuple[Coordinate, Coordinate]


class _Own(Struct, frozen=True, forbid_unknown_fields=True, kw_only=True):
    """Base of the parameters: immutable, without unknown keys, keyword-only."""


class Directed(_Own, frozen=True):
    """Parameters of directed locomotion.

    Attributes:
        heading_deg: direction to go, from world x towards y [degrees].
        drift_weight: penalty of drift.
        limit: greatest realistic speed [m/s].
    """

    heading_deg: Angle = 0.0
    drift_weight: NotNegative = 1.0
    limit: Limit = 1.0


def directed_locomotion(trace: Trace, parameters: Directed) -> float:
    """Return f = (a - drift_weight b) / T [m/s], or 0 if a / T is above the limit.

    a is the net distance along the heading, b the greatest distance from the straight
    line through the start, both in the ground plane [m]; T is the duration [s].

    Source: own definition.
    """
    angle = radians(parameters.heading_deg)
    x, y = _moved(trace).T
    along = float(cos(angle) * x[-1] + sin(angle) * y[-1])
    drift = float(abs(cos(angle) * y - sin(angle) * x).max())
    seconds = trace.duration_s
    if along / seconds > parameters.limit:
        return 0.0
    return (along - parameters.drift_weight * drift) / seconds


class Targets(_Own, frozen=True):
    """Parameters of going to targets.

    Attributes:
        targets: x and y of each, in the order in which to reach them, world frame [m].
        reach_m: distance at which a target is reached [m].
        limit: greatest realistic speed [m/s].
    """

    targets: Annotated[tuple[_Place, ...], Meta(min_length=1, max_length=100)] = (
        (1.0, 0.0),
    )
    reach_m: Extent = 0.1
    limit: Limit = 1.0


def target(trace: Trace, parameters: Targets) -> float:
    """Return the speed at which the core goes from target to target [m/s].

    The way to a target is the straight line from the previous one, and to the first
    from the start. f = (sum of the ways to reached targets + how much nearer the core
    ends to the next one) / t. t is the time at which the last target is reached [s],
    or the duration. f is 0 if it is above the limit, or if the robot starts at all
    targets; it is negative if the core ends farther from the next one.

    Source: own definition.
    """
    places = [(float(x), float(y)) for x, y in trace.core_position[:, :2]]
    credit, sample, origin = 0.0, 0, places[0]
    for goal in parameters.targets:
        way = _distance(origin, goal)
        while _distance(places[sample], goal) > parameters.reach_m:
            if sample == len(places) - 1:
                nearer = way - _distance(places[sample], goal)
                return _within((credit + nearer) / trace.duration_s, parameters.limit)
            sample += 1
        credit, origin = credit + way, goal
    seconds = sample * trace.interval_s
    return _within(credit / seconds, parameters.limit) if seconds else 0.0


class Light(_Own, frozen=True):
    """Parameters of going to the light.

    Attributes:
        full_within_m: distance within which brightness is 1, as for light sensors [m].
    """

    full_within_m: Extent = 1.0


def light(trace: Trace, parameters: Light) -> float:
    """Return the mean brightness at the core, in (0, 1].

    The brightness at distance d from the light is min(1, (full_within_m / d)^2), that
    of a light sensor that faces the light, hidden or not.

    Raises:
        ExperimentError: the world has no light.

    Source: own definition; the fall with distance is that of light sensors.
    """
    if trace.light is None:
        raise ExperimentError(
            "the task `light` needs a light: set environment.light = [x, y, z]"
        )
    squares = ((trace.core_position - trace.light) ** 2).sum(axis=1)
    full = parameters.full_within_m**2
    shares = [min(1.0, full / square) if square else 1.0 for square in squares.tolist()]
    return sum_in_order(shares) / len(shares)


class Turning(_Own, frozen=True):
    """Parameters of turning in place.

    Attributes:
        direction: rewarded sense, seen from above.
        wander_weight: penalty of leaving the place [rad/m].
        limit: greatest realistic angular velocity [rad/s].
    """

    direction: Literal["either", "left", "right"] = "either"
    wander_weight: NotNegative = 5.0
    limit: Limit = 10.0


@needs("core_attitude")
def turning(trace: Trace, parameters: Turning) -> float:
    """Return f = (a - wander_weight b) / T [rad/s], or 0 if a / T is above the limit.

    a is the angle by which the core has turned about the vertical [rad], counted over
    full turns: the sum of the vertical components of the rotations between samples.
    Rolling over does not count. b is the greatest distance of the core from its start
    in the ground plane [m]; T is the duration [s].

    The core turns by less than half a turn between two samples.

    Source: own definition.
    """
    turned = sum_in_order(starmap(_vertical_turn, pairwise(trace.core_attitude)))
    senses = {"left": turned, "right": -turned, "either": abs(turned)}
    angle, seconds = senses[parameters.direction], trace.duration_s
    if angle / seconds > parameters.limit:
        return 0.0
    wandered = max(hypot(x, y) for x, y in _moved(trace).tolist())
    return (angle - parameters.wander_weight * wandered) / seconds


class Balance(_Own, frozen=True):
    """Parameters of staying upright.

    Attributes:
        tilt_deg: greatest tilt of an upright core [degrees].
        drift_weight: penalty of leaving the place [m/m].
        limit: greatest realistic height [m].
    """

    tilt_deg: Annotated[float, Meta(gt=0, lt=90)] = 30.0
    drift_weight: NotNegative = 0.05
    limit: Limit = 1.0


@needs("core_attitude")
def balance(trace: Trace, parameters: Balance) -> float:
    """Return f = h - drift_weight b [m], or 0 if h is above the limit.

    h is the mean height of the core's centre over z = 0; it counts as 0 while the
    core's own z axis is tilted from the vertical by more than ``tilt_deg``. b is the
    greatest distance of the core from its start in the ground plane [m].

    Source: own definition.
    """
    least = cos(radians(parameters.tilt_deg))
    x, y = trace.core_attitude[:, 1], trace.core_attitude[:, 2]
    # The z component of the core's z axis.
    is_upright = 1.0 - 2.0 * (x * x + y * y) >= least
    height = float((trace.core_position[:, 2] * is_upright).mean())
    if height > parameters.limit:
        return 0.0
    drift = max(hypot(dx, dy) for dx, dy in _moved(trace).tolist())
    return height - parameters.drift_weight * drift


def _moved(trace: Trace) -> Floats:
    """Return how far the core is from its start in the ground plane, (T, 2) [m]."""
    moved: Floats = trace.core_position[:, :2] - trace.core_position[0, :2]
    return moved


def _distance(one: _Place, other: _Place) -> float:
    return hypot(one[0] - other[0], one[1] - other[1])


def _within(value: float, limit: float) -> float:
    return 0.0 if value > limit else value


def _vertical_turn(before: Floats, after: Floats) -> float:
    """Return the vertical component of the rotation between two attitudes [rad]."""
    (a, b, c, d), (w, x, y, z) = before.tolist(), after.tolist()
    # after times the inverse of before: the rotation in the world frame.
    real = w * a + x * b + y * c + z * d
    vector = (
        -w * b + x * a - y * d + z * c,
        -w * c + x * d + y * a - z * b,
        -w * d - x * c + y * b + z * a,
    )
    if real < 0.0:
        real, vector = -real, (-vector[0], -vector[1], -vector[2])
    size = sqrt(sum_in_order(each * each for each in vector))
    return 2.0 * atan2(size, real) * vector[2] / size if size else 0.0
