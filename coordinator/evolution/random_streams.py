"""Random streams: each named by what it is for, and read in blocks of plain floats.

No draw depends on how many draws happened elsewhere or on the order in which
answers arrive, so the same seed gives the same births on any number of workers.
"""

from collections.abc import Iterator, Sequence
from enum import IntEnum
from itertools import chain
from statistics import NormalDist
from typing import TypeVar

import numpy as np

from schema.parts import Parameter
from schema.robot.ids import BirthId

T = TypeVar("T")

_BLOCK = 128
_TINY = 2.0**-54


class Purpose(IntEnum):
    """Purpose of a stream; the numbers are part of what a seed means.

    The birth id that names a stream of migration is (island, epoch); for the place of
    an immigrant it is (island, number of immigrants), for a decision of an arena's
    rules (island, step). 11 to 13 belong to workers
    (noise, pushes, disturbances). The attempt that names a stream of a learner is the
    number of its request.
    """

    GENERATE = 1
    PARENTS = 2
    MATE = 3
    SURVIVORS = 4
    PLACE = 5
    DURATION = 6
    TOPOLOGY = 7
    EMIGRANTS = 8
    REPLACED = 9
    IMMIGRANT_PLACE = 10
    LEARNING = 14
    RULES = 15
    OTHER_BRAIN = 20


def stream(
    seed: int, run: int, birth: BirthId, attempt: int, purpose: Purpose
) -> np.random.Generator:
    """Return the stream of one purpose of one attempt at one birth.

    Its seed sequence is that of ``SeedSequence(seed, spawn_key=(run, island, birth,
    attempt, purpose))``; the seed of the run is < 2^64.
    """
    # NumPy makes these 32-bit words of a seed and a key, but slowly, number by number.
    key = (run, birth.island, birth.number, attempt, purpose)
    words = np.array((seed & 0xFFFFFFFF, seed >> 32, 0, 0, *key), np.uint32)
    return np.random.Generator(np.random.PCG64(np.random.SeedSequence(words)))


class BufferedRng:
    """Random choices from one stream, in the order of the calls.

    A scalar call to NumPy costs more than most of what variation does with it, so the
    stream is read in blocks; ``number`` returns the next one, uniform in [0, 1).
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

    def pick(self, items: Sequence[T]) -> T:
        """Return one item, uniformly; there must be at least one."""
        return items[int(self.number() * len(items))]

    def sample(self, items: Sequence[T], count: int) -> list[T]:
        """Return ``count`` items without replacement, in random order."""
        rest = list(items)
        return [rest.pop(self.below(len(rest))) for _ in range(count)]

    def values(self, parameters: Sequence[Parameter]) -> tuple[float, ...]:
        """Return one value for each parameter, uniform in its range."""
        return tuple([p.low + (p.high - p.low) * self.number() for p in parameters])

    def nearby(
        self, parameters: Sequence[Parameter], values: Sequence[float], epsilon: float
    ) -> tuple[float, ...]:
        """Return values moved by the share ``epsilon`` of the way to random ones.

        Immutable parameters keep their value; so do all for 0, while 1 draws new ones.
        """
        moved: list[float] = []
        number, rest = self.number, 1.0 - epsilon
        for p, v in zip(parameters, values, strict=True):
            if not p.is_mutable:
                moved.append(v)
                continue
            low, high = p.low, p.high
            near = rest * v + epsilon * (low + (high - low) * number())
            # Rounding must not carry a value out of its range.
            if not low <= near <= high:
                near = low if near < low else high
            moved.append(near)
        return tuple(moved)

    def normal(self, mean: float, sd: float) -> float:
        """Return a normally distributed number; the mean itself where sd is 0."""
        number = self.number()
        return NormalDist(mean, sd).inv_cdf(number or _TINY) if sd > 0.0 else mean

    def rounded(self, expected: float) -> int:
        """Return a neighbouring integer whose mean is ``expected``, >= 0."""
        whole = int(expected)
        return whole + self.chance(expected - whole)
