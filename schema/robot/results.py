"""Results of vetting and evaluating a robot."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from schema.parts import Vector
from schema.robot.trace import Trace

Floats = npt.NDArray[np.float64]


Track = Trace
"""Former name of ``Trace``, which fitness functions of users import."""


@dataclass(frozen=True, slots=True)
class Evaluation:
    """Result of one simulation.

    Attributes:
        fitness: always maximised, finite.
        path_velocity: path length over time in the ground plane [m/s].
        straight_velocity: net distance over time in the ground plane [m/s].
        simulated_s: simulated time [s].
        measures: finite, in the order of the experiment's ``measures.names``.
    """

    fitness: float
    path_velocity: float
    straight_velocity: float
    simulated_s: float
    measures: tuple[float, ...] = ()


@dataclass(frozen=True, slots=True)
class Provenance:
    """Agent, platform and duration [s] of an answer; information only."""

    agent: str = ""
    platform: str = ""
    wall_s: float = 0.0


def failed_fitness(others: Iterable[float]) -> float:
    """Return what a failed evaluation counts as: 0, or the least of others below 0.

    Args:
        others: fitness that it is compared with.
    """
    return min((0.0, *others))


@dataclass(frozen=True, slots=True)
class Report:
    """Report of the analyzer on a body in its neutral pose.

    Attributes:
        is_viable: the body can be built and simulated.
        reason: why not; empty if viable.
        intersections: index pairs of parts that intersect, ascending.
        lower, upper: corners of the axis-aligned bounding box, core frame [m].
        mass: of all parts [kg].
        motors: number of driven joints.
    """

    is_viable: bool
    reason: str
    intersections: tuple[tuple[int, int], ...]
    lower: Vector
    upper: Vector
    mass: float
    motors: int
