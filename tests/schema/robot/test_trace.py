"""Sums of floats worked out by hand, and what importing traces costs."""

import subprocess
import sys

import pytest

from schema.robot import results
from schema.robot.trace import Trace, sum_in_order


@pytest.mark.parametrize(
    ("numbers", "total"),
    [([], 0.0), ([0.5, 2], 2.5), ([1e16, 1.0, -1e16], 0.0), (10 * [0.1], 1.0 - 2**-53)],
)
def test_each_addition_is_rounded(numbers: list[float], total: float) -> None:
    """As the sums of Python 3.11; exact sums would be 1 and 1."""
    assert sum_in_order(iter(numbers)) == total


def test_a_trace_has_its_former_name() -> None:
    """Fitness functions of users import it."""
    assert results.Track is Trace
    assert not hasattr(results, "Tracks")


def test_hubs_and_pools_do_without_numpy() -> None:
    program = "import sys, schema.agent.service; sys.exit('numpy' in sys.modules)"
    subprocess.run([sys.executable, "-c", program], check=True)
