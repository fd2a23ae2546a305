"""Chance, cheaply: one random stream read in blocks of plain floats.

A scalar call to numpy costs more than most of what variation does with it.
"""

from collections.abc import Iterator, Sequence
from itertools import chain
from statistics import NormalDist
from typing import TypeVar

import numpy as np

from schema.parts import Parameter

T = TypeVar("T")

_BLOCK = 128
_TINY = 2.0**-54


class BufferedRng:
    """Draws from one stream, in the order in which they are asked for.

    Attributes:
        number: the next number, uniform in [0, 1).
    """

    __slots__ = ("number",)

    def __init__(self, rng: np.random.Generator) -> None:
        blocks: Iterator[list[float]] = iter(lambda: rng.random(_BLOCK).tolist(), None)
        self.number = chain.from_iterable(blocks).__next__

    def chance(self, probability: float) -> bool:
        """Return true with a probability; never for 0, always for 1."""
        return self.number() < probability

    def below(self, count: int) -> int:
        """Return an integer, uniform in 0..count - 1; count >= 1."""
        return int(self.number() * count)

    def pick(self, things: Sequence[T]) -> T:
        """Return one of the things, uniformly; there must be one."""
        return things[int(self.number() * len(things))]

    def sample(self, things: Sequence[T], count: int) -> list[T]:
        """Return ``count`` of the things without replacement, in random order."""
        rest = list(things)
        return [rest.pop(self.below(len(rest))) for _ in range(count)]

    def value(self, parameter: Parameter) -> float:
        """Return a value of a parameter, uniform in its range."""
        return parameter.low + (parameter.high - parameter.low) * self.number()

    def values(self, parameters: Sequence[Parameter]) -> tuple[float, ...]:
        """Return one value for each parameter, uniform in its range."""
        return tuple(map(self.value, parameters))

    def nearby(
        self,
        parameters: Sequence[Parameter],
        values: Sequence[float],
        epsilon: float,
    ) -> tuple[float, ...]:
        """Return values moved by a share of the way to random ones.

        Args:
            parameters: their ranges; what is not mutable stays as it is.
            values: one for each parameter.
            epsilon: 0 leaves them, 1 draws them anew.
        """
        moved: list[float] = []
        number, rest = self.number, 1.0 - epsilon
        for p, v in zip(parameters, values, strict=True):
            if not p.is_mutable:
                moved.append(v)
                continue
            near = rest * v + epsilon * (p.low + (p.high - p.low) * number())
            # Rounding must not carry a value out of its range.
            moved.append(p.low if near < p.low else min(near, p.high))
        return tuple(moved)

    def normal(self, mean: float, sd: float) -> float:
        """Return a normally distributed number; the mean itself where sd is 0."""
        number = self.number()
        return NormalDist(mean, sd).inv_cdf(number or _TINY) if sd > 0.0 else mean

    def rounded(self, expected: float) -> int:
        """Return a neighbouring integer whose mean is ``expected``, >= 0."""
        whole = int(expected)
        return whole + self.chance(expected - whole)
