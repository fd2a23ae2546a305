"""The learner of an island: loading, checks of what it proposes and of its contract.

Built in are CMA-ES, (1+1) evolution strategy and random search.
"""

from collections.abc import Callable, Sequence
from functools import lru_cache
from math import inf
from typing import Annotated

import numpy as np
from msgspec import Meta, Struct

from schema.errors import ExperimentError
from schema.experiment.brains import NoParameters
from schema.experiment.learning import LEARNERS, Learning
from schema.plugins.contract import broken
from schema.plugins.load import load_object
from schema.plugins.origin import naming_plugin, where_defined
from schema.plugins.parameters import read_parameters
from schema.plugins.protocols import Learner
from schema.robot.trace import Floats


class CmaEs:
    """Evolution strategy that adapts the covariance matrix of its steps.

    The first generation contains the start, so that no trial is wasted. A point outside
    the range is drawn again, up to 100 times; then it moves to the ends of the range.

    Source: Hansen and Ostermeier, Completely derandomized self-adaptation in evolution
    strategies, 2001; as in Hansen, The CMA evolution strategy: a tutorial, 2016, by the
    library ``cmaes``.
    """

    class Parameters(Struct, frozen=True):
        """Parameters of ``cma-es``.

        Attributes:
            population: points of a generation; not given, 4 + 3 ln N, rounded down, for
                N parameters.
        """

        population: Annotated[int, Meta(ge=4, le=1000)] | None = None

    def __init__(self, start: Floats, sigma: float, parameters: Parameters) -> None:
        """Initialise the search; arguments as of ``schema.plugins.protocols``."""
        # Only experiments that learn need the library.
        from cmaes import CMA  # noqa: PLC0415

        bounds = np.tile([0.0, 1.0], (len(start), 1))
        size = parameters.population
        self._search = CMA(start, sigma, bounds=bounds, population_size=size)
        self._told: list[tuple[Floats, float]] = []
        self._left = self._search.population_size - 1

    def ask(self, rng: np.random.Generator, most: int) -> Sequence[Floats]:
        """Return the rest of a generation."""
        self._search.reseed_rng(int(rng.integers(2**32)))
        return [self._search.ask() for _ in range(min(self._left, most))]

    def tell(self, points: Floats, fitness: Floats) -> None:
        """Note fitness; adapt mean, step size and covariance after a generation."""
        # The library minimises.
        self._told += zip(points, (-fitness).tolist(), strict=True)
        self._left = size = self._search.population_size
        if len(self._told) == size:
            self._search.tell(self._told)
        self._told = []


class OnePlusOne:
    """(1+1)-ES with the one-fifth rule: success widens the step, failure narrows it.

    Source: Rechenberg 1973; factors of Auger, Benchmarking the (1+1) evolution strategy
    with one-fifth success rule on the BBOB-2009 function testbed, 2009.
    """

    def __init__(self, start: Floats, sigma: float, _parameters: None) -> None:
        """Initialise the search; arguments as of ``schema.plugins.protocols``."""
        self._best, self._fitness = start, -np.inf
        self._sigma = sigma
        self._is_new = True

    def ask(self, rng: np.random.Generator, _most: int) -> Floats:
        """Return one point near the best; points outside move to the range's ends."""
        step = self._sigma * rng.standard_normal(len(self._best))
        return np.clip(self._best + step, 0.0, 1.0)[None]

    def tell(self, points: Floats, fitness: Floats) -> None:
        """Keep the better point, and adapt the step."""
        for point, value in zip(points, fitness.tolist(), strict=True):
            is_start, self._is_new = self._is_new, False
            is_better = value >= self._fitness
            if is_better:
                self._best, self._fitness = point, value
            if not is_start:
                # Four failures undo one success.
                self._sigma *= 1.5 if is_better else 1.5**-0.25


class RandomSearch:
    """Points that are uniform in the range of each parameter: the baseline."""

    def __init__(self, start: Floats, _sigma: float, _parameters: None) -> None:
        """Initialise the search; arguments as of ``schema.plugins.protocols``."""
        self._count = len(start)

    def ask(self, rng: np.random.Generator, most: int) -> Floats:
        """Return all points at once."""
        return rng.random((most, self._count))

    def tell(self, points: Floats, fitness: Floats) -> None:
        """Note nothing."""


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

        Its start are the parameters of the brain at birth or of the best sample, as
        shares of their ranges.

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
