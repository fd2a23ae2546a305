"""Built-in learners: CMA-ES, (1+1) evolution strategy and random search."""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from msgspec import Meta, Struct

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
