"""CMA-ES as a learner, by the library ``cmaes``.

Source: Hansen and Ostermeier, Completely derandomized self-adaptation in evolution
strategies, 2001; as in Hansen, The CMA evolution strategy: a tutorial, 2016.
"""

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from msgspec import Meta, Struct

from schema.robot.trace import Floats


class CmaEs:
    """Evolution strategy that adapts the covariance matrix of its steps.

    The first generation contains the start, so that no trial is wasted. A point outside
    the range is drawn again, up to 100 times; then it moves to the ends of the range.
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
