"""Results of vetting and evaluating a robot."""

from collections.abc import Iterable, Sequence
from statistics import fmean
from typing import Annotated

from msgspec import Meta, Struct

from schema.limits import LONGEST_WALL_S, MOST_MEASURES, MOST_PAIRS, Finite
from schema.parts import Vector

Measures = Annotated[tuple[Finite, ...], Meta(max_length=MOST_MEASURES)]
WallTime = Annotated[float, Meta(ge=0, le=LONGEST_WALL_S)]
"""Duration by the clock [s]; information only."""


def __getattr__(name: str) -> type:
    """Return ``Trace`` by its former name, which fitness functions of users import.

    Not imported before it is used: hubs and pools of agents do without NumPy.
    """
    if name == "Track":
        from schema.robot.trace import Trace  # noqa: PLC0415

        return Trace
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


class Evaluation(Struct, frozen=True, forbid_unknown_fields=True, tag="evaluation"):
    """Result of one simulation.

    Attributes:
        fitness: always maximised, finite.
        path_velocity: path length over time in the ground plane [m/s].
        straight_velocity: net distance over time in the ground plane [m/s].
        simulated_s: simulated time [s].
        measures: finite, in the order of the experiment's ``measures.names``.
    """

    fitness: Finite
    path_velocity: Finite
    straight_velocity: Finite
    simulated_s: Finite
    measures: Measures = ()


class Provenance(Struct, frozen=True, forbid_unknown_fields=True):
    """Agent, platform and duration [s] of an answer; information only."""

    agent: str = ""
    platform: str = ""
    wall_s: WallTime = 0.0


def failed_fitness(others: Iterable[float]) -> float:
    """Return what a failed evaluation counts as: 0, or the least of others below 0."""
    return min((0.0, *others))


def later_fitness(later: Sequence[float | None]) -> float:
    """Return the mean fitness in later windows; None is a failed evaluation's."""
    failed = failed_fitness(each for each in later if each is not None)
    return fmean(failed if each is None else each for each in later)


def sustained(selected: float | None, later: Sequence[float | None]) -> float | None:
    """Return the share of its fitness that a robot has in later windows.

    Args:
        selected: fitness in the window of the evaluation; None if that failed.
        later: fitness in each window after it, as of ``later_fitness``.

    Returns:
        Mean of the later windows over ``selected``; None if that is not positive.

    Source: own definition.
    """
    if selected is None or selected <= 0:
        return None
    return later_fitness(later) / selected


class Report(Struct, frozen=True, forbid_unknown_fields=True, tag="report"):
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
    intersections: Annotated[tuple[tuple[int, int], ...], Meta(max_length=MOST_PAIRS)]
    lower: Vector
    upper: Vector
    mass: Finite
    motors: int
