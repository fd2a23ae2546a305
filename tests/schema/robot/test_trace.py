"""Sums of floats against sums worked out by hand."""

import pytest

from schema.robot.trace import sum_in_order


@pytest.mark.parametrize(
    ("numbers", "total"),
    [([], 0.0), ([0.5, 2], 2.5), ([1e16, 1.0, -1e16], 0.0), (10 * [0.1], 1.0 - 2**-53)],
)
def test_each_addition_is_rounded(numbers: list[float], total: float) -> None:
    """As the sums of Python 3.11; exact sums would be 1 and 1."""
    assert sum_in_order(iter(numbers)) == total
