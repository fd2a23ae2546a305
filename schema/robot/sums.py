"""Sums that are equal in all versions of Python."""

from collections.abc import Iterable
from functools import reduce
from operator import add


def sum_in_order(numbers: Iterable[float]) -> float:
    """Return the sum of floats, rounded after each addition, in their order.

    ``sum`` of Python 3.12 and later compensates for rounding, that of 3.11 does not.
    Evaluations must not depend on the version that a worker runs.
    """
    return reduce(add, numbers, 0.0)
