"""Learners of a few lines: the (1+1) evolution strategy and random search."""

import numpy as np

from schema.robot.trace import Floats


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
