"""The learner of an island: loading, checks of what it proposes and of its contract."""

from collections.abc import Callable, Sequence
from functools import lru_cache
from math import inf

import numpy as np
from msgspec import Struct

from coordinator.evolution.learners.built_in import CmaEs, OnePlusOne, RandomSearch
from schema.errors import ExperimentError
from schema.experiment.brains import NoParameters
from schema.experiment.learning import LEARNERS, Learning
from schema.plugins.contract import broken
from schema.plugins.load import load_object
from schema.plugins.origin import naming_plugin, where_defined
from schema.plugins.parameters import read_parameters
from schema.plugins.protocols import Learner
from schema.robot.trace import Floats

WHERE = "learning.learner"
METHODS = ("ask", "tell")
BUILT_IN: dict[str, Callable[..., Learner]] = dict(
    zip(LEARNERS, (CmaEs, OnePlusOne, RandomSearch), strict=True)
)
"""Built-in learners by their short names."""

Points = tuple[tuple[float, ...], ...]
"""Points that are tried together, each a share for each parameter."""
Batch = tuple[Points, tuple[float, ...]]
"""Points and their fitness, -inf for a failed trial."""


@lru_cache(maxsize=64)
def learner_class(rules: Learning) -> tuple[Callable[..., Learner], Struct | None]:
    """Return the class of a learner, and its parameters or None.

    Raises:
        UnknownPlugin: no such learner, or a module that is not allowed.
        ExperimentError: a class without the methods of a learner, or invalid
            parameters.
    """
    found = load_object(rules.learner, WHERE, BUILT_IN, METHODS)
    if not isinstance(found, type):
        where = where_defined(found)
        raise ExperimentError(f"{WHERE}: {where}: must be a class, not an object")
    kind = getattr(found, "Parameters", None)
    table = rules.parameters
    parameters = read_parameters(table, kind or NoParameters, "learning.parameters")
    return found, parameters if kind else None


class NewbornLearner:
    """The learner of one newborn; an error of its own code becomes one line."""

    def __init__(self, rules: Learning, start: Sequence[float]) -> None:
        """Make the learner.

        Its start are the parameters of the brain at birth, as shares of their ranges.

        Raises:
            ExperimentError: as of ``learner_class``, or the class raises.
        """
        self._class, parameters = learner_class(rules)
        self._count = len(start)
        point = np.array(start, float)
        with naming_plugin(WHERE, self._class):
            self._learner: Learner = self._class(point, rules.sigma, parameters)

    def tell(self, batch: Batch) -> None:
        """Tell the fitness of all points that were tried together."""
        points, fitness = (np.array(each, float) for each in batch)
        with naming_plugin(WHERE, self._class):
            self._learner.tell(points, fitness)

    def ask(self, rng: np.random.Generator, most: int) -> Points:
        """Return the next points to try together.

        The stream is that of this request alone.

        Raises:
            ExperimentError: the learner raises, or returns anything else.
        """
        with naming_plugin(WHERE, self._class):
            answer = self._learner.ask(rng, most)
            try:
                points: Floats = np.array(answer, float)
            except (TypeError, ValueError):
                points = np.empty(0)
            if (
                points.ndim != 2  # noqa: PLR2004 - a point in each row
                or not 1 <= len(points) <= most
                or points.shape[1] != self._count
            ):
                rule = f"return 1 to {most} points of {self._count} numbers"
                raise broken("ask", rule, came=f"shape {points.shape}")
            # Also false for what is not a number.
            outside = ~((points >= 0.0) & (points <= 1.0))
            if outside.any():
                raise broken(
                    "ask", "return numbers from 0 to 1", float(points[outside][0])
                )
        return tuple(map(tuple, points.tolist()))


_TRIALS = 24


def check_learner(rules: Learning) -> None:
    """Raise unless a learner keeps its contract.

    It learns 1, 3 and 20 parameters, with trials that fail among others. After each
    request, a second learner is told what was tried and must want the same.

    Raises:
        ExperimentError: as of ``learner_class``; it raises, asks for other than points
            from 0 to 1, or depends on anything but what it was told and the stream.
    """
    for count in (1, 3, 20):
        start = (0.25,) * count
        learner = NewbornLearner(rules, start)
        told: list[Batch] = []
        tried = 1
        while tried < _TRIALS:
            other = NewbornLearner(rules, start)
            for batch in told:
                other.tell(batch)
            first, second = (
                asked.ask(np.random.default_rng(tried), _TRIALS - tried)
                for asked in (learner, other)
            )
            if first != second:
                rule = "want the same when it was told the same"
                raise broken("", rule, came=f"{first[0]} and {second[0]}")
            points = first if told else (start, *first)
            told.append((points, tuple(map(_fitness, points))))
            learner.tell(told[-1])
            tried += len(first)


def _fitness(point: tuple[float, ...]) -> float:
    """Return the negative distance to a point; -inf far from it."""
    distance = float(np.linalg.norm(np.array(point) - 0.6))
    return -distance if distance < 0.5 * len(point) ** 0.5 else -inf
