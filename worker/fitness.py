"""Fitness functions.

A fitness function is any ``module:attribute`` that takes a trace and its parameters
and returns a finite number, higher is better. Its second argument is annotated with a
msgspec Struct, which gets the table ``[fitness.parameters]``; without such an
annotation it gets the experiment's fitness section.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np

from schema.errors import FitnessUndefined, error_text
from schema.experiment.document import Fitness
from schema.experiment.settings import fitness_argument, fitness_function
from schema.robot.results import Evaluation
from schema.robot.trace import Trace, sum_in_order


@dataclass(frozen=True, slots=True)
class TraceFunction:
    """Fitness function or measure of an experiment, with arguments beside a trace."""

    name: str
    function: Callable[..., float]
    arguments: tuple[Any, ...] = ()

    def value(self, trace: Trace) -> float:
        """Return the value of a trace, which has two samples or more.

        Raises:
            FitnessUndefined: the function raised or gave no finite number.
        """
        try:
            value = float(self.function(trace, *self.arguments))
        except Exception as error:
            story = f"{self.name} raised {error_text(error)}"
            raise FitnessUndefined(story) from error
        if not math.isfinite(value):
            raise FitnessUndefined(
                f"{self.name} must return a finite number, got {value}"
            )
        return value


@dataclass(frozen=True, slots=True)
class Functions:
    """Functions of an experiment, and the channels of traces that they declare."""

    fitness: TraceFunction
    measures: tuple[TraceFunction, ...]
    channels: tuple[str, ...]

    def evaluation(self, trace: Trace, simulated_s: float) -> Evaluation:
        """Return the evaluation of a trace; the time includes the warm-up [s].

        Raises:
            FitnessUndefined: the fitness function or a measure raised or gave no
                finite number.
        """
        return Evaluation(
            self.fitness.value(trace),
            path_velocity(trace),
            straight_velocity(trace),
            simulated_s,
            tuple([measure.value(trace) for measure in self.measures]),
        )


def load_fitness(fitness: Fitness) -> TraceFunction:
    """Return the fitness function that an experiment names.

    Raises:
        ExperimentError: an unknown function, or parameters that it refuses.
    """
    function = fitness_function(fitness)
    argument = fitness_argument(function, fitness)
    return TraceFunction(fitness.function, function, (argument,))


@lru_cache(maxsize=1)  # both the fitness and the record of a robot need it
def path_velocity(track: Trace) -> float:
    """Return path length over time in the ground plane [m/s]."""
    steps = np.diff(track.core_position, axis=0)
    lengths = map(math.hypot, steps[:, 0].tolist(), steps[:, 1].tolist())
    return sum_in_order(lengths) / track.duration_s


def straight_velocity(track: Trace) -> float:
    """Return net distance over time in the ground plane [m/s]."""
    x, y = (track.core_position[-1, :2] - track.core_position[0, :2]).tolist()
    return math.hypot(x, y) / track.duration_s


def thesis(track: Trace, fitness: Fitness) -> float:
    """Return f = path_weight v + straight_weight s [m/s], or 0 above the limit.

    v is the path velocity, s the straight one, of (T, 3) positions, T >= 2. The limit
    is one of fitness, not of speed: fitness above it comes from broken physics. The
    weights are 1 and 5 in the thesis, the limit is 1.0.

    Source: Hupkes 2016, equation 5.1, and its published code for the limit.
    """
    value = fitness.path_weight * path_velocity(
        track
    ) + fitness.straight_weight * straight_velocity(track)
    return 0.0 if value > fitness.limit else value
