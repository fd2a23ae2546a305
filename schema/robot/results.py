"""What vetting and evaluating a robot come to."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from schema.parts import Vector

Floats = npt.NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Track:
    """Where a robot's core went: what every fitness function is given.

    Attributes:
        interval_s: time between two samples [s].
        core_position: (T, 3) centre of the core, world frame, z up [m]; sample 0
            is the start of the window, T >= 2.
    """

    interval_s: float
    core_position: Floats


@dataclass(frozen=True, slots=True)
class Evaluation:
    """One simulation's outcome.

    Attributes:
        fitness: always maximised, finite.
        path_velocity: path length over time in the ground plane [m/s].
        straight_velocity: net distance over time in the ground plane [m/s].
        simulated_s: simulated time [s].
    """

    fitness: float
    path_velocity: float
    straight_velocity: float
    simulated_s: float


@dataclass(frozen=True, slots=True)
class Provenance:
    """Who found an answer and how long it took; never decides anything."""

    agent: str = ""
    platform: str = ""
    wall_s: float = 0.0


@dataclass(frozen=True, slots=True)
class Report:
    """What the analyzer says of a body in its neutral pose.

    Attributes:
        is_viable: it may live.
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
