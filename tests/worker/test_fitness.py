"""Exact fitness of hand-made tracks, and the contract of fitness functions."""

import numpy as np
import pytest
from msgspec import Struct

from schema.errors import ExperimentError, FitnessUndefined
from schema.experiment.document import Fitness
from schema.experiment.settings import fitness_argument
from schema.plugins.protocols import FitnessFunction
from schema.plugins.simple_traces import check_function
from schema.robot.trace import Trace
from worker.fitness import (
    TraceFunction,
    path_velocity,
    straight_velocity,
    thesis,
)

WEIGHTS = Fitness()


def track(*points: tuple[float, float, float], interval_s: float = 0.25) -> Trace:
    """Return a track through some points."""
    return Trace(interval_s, np.array(points))


@pytest.mark.parametrize(
    ("points", "path", "straight"),
    [
        (((0, 0, 0), (0.25, 0, 0), (0.5, 0, 0)), 1.0, 1.0),
        # Legs of 3 and 4 make a path of 7 and a distance of 5, in 0.5 s.
        (((1, 1, 0), (4, 1, 0), (4, 5, 0)), 14.0, 10.0),
        # Height does not count.
        (((0, 0, 5), (0, 0, 2), (0, 0, 0)), 0.0, 0.0),
        (((0, 0, 0), (0.125, 0, 0), (0, 0, 0)), 0.5, 0.0),
        (((8, -4, 1), (8.03125, -4, 1)), 0.125, 0.125),
    ],
)
def test_straight_velocity_counts_five_times(
    points: tuple[tuple[float, float, float], ...], path: float, straight: float
) -> None:
    found = track(*points)
    assert (path_velocity(found), straight_velocity(found)) == (path, straight)
    assert thesis(found, Fitness(limit=100.0)) == path + 5 * straight


def test_fitness_above_the_limit_is_zero() -> None:
    weights = Fitness(path_weight=1.0, straight_weight=1.0)
    assert thesis(track((0, 0, 0), (0.125, 0, 0)), weights) == 1.0
    assert thesis(track((0, 0, 0), (0.126, 0, 0)), weights) == 0.0


def _writes(track: Trace, fitness: Fitness) -> float:
    track.core_position[0] += 1.0
    return fitness.limit


class Light(Struct, frozen=True):
    """Parameters of a fitness of a test."""

    reach_m: float
    power: int = 2


def _seeks(trace: Trace, parameters: Light) -> float:
    return parameters.reach_m**parameters.power + float(trace.core_position[-1, 0])


def test_own_parameters_are_read_as_the_struct_of_the_second_argument() -> None:
    fitness = Fitness(parameters={"reach_m": 3.0})
    assert fitness_argument(_seeks, fitness) == Light(3.0, 2)
    check_function(_seeks, Light(3.0, 2))
    message = "fitness.parameters: must have a key 'reach_m'"
    with pytest.raises(ExperimentError, match=message):
        fitness_argument(_seeks, Fitness())
    with pytest.raises(ExperimentError, match=r"fitness.parameters.reach: no such"):
        fitness_argument(_seeks, Fitness(parameters={"reach": 3.0}))


def test_parameters_of_a_function_without_a_struct_are_refused() -> None:
    message = r"thesis has no parameters of its own; its keys are those of \[fitness\]$"
    with pytest.raises(ExperimentError, match=message):
        fitness_argument(thesis, Fitness(parameters={"reach_m": 3.0}))
    own = Fitness(function=f"{__name__}:_writes", parameters={"reach_m": 3.0})
    with pytest.raises(ExperimentError, match="it must annotate its second argument"):
        fitness_argument(_writes, own)


def test_the_reason_of_a_failure_is_one_line() -> None:
    def raises(_trace: Trace) -> float:
        raise ValueError("two\n  lines")

    message = "^own raised ValueError: two lines$"
    with pytest.raises(FitnessUndefined, match=message):
        TraceFunction("own", raises).value(Trace(1.0, np.zeros((2, 3))))


def test_function_may_raise_for_some_traces() -> None:
    def picky(trace: Trace, _fitness: Fitness) -> float:
        if len(trace.core_position) == 2:
            raise ValueError("too short")
        return 0.0

    check_function(picky, WEIGHTS)


@pytest.mark.parametrize(
    ("function", "message"),
    [
        (lambda trace, _: trace.energy[-1], "energy is not recorded: .* @needs"),
        (_writes, "must not write to its arguments"),
    ],
)
def test_function_that_breaks_the_contract_is_rejected(
    function: FitnessFunction, message: str
) -> None:
    with pytest.raises(ExperimentError, match=message):
        check_function(function, WEIGHTS)
