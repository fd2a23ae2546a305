"""Results of robots: what importing them costs, and a former name."""

import subprocess
import sys

from schema.robot import results
from schema.robot.trace import Trace


def test_a_trace_has_its_former_name() -> None:
    """Fitness functions of users import it."""
    assert results.Track is Trace
    assert not hasattr(results, "Tracks")


def test_hubs_and_pools_do_without_numpy() -> None:
    program = "import sys, schema.agent.service; sys.exit('numpy' in sys.modules)"
    subprocess.run([sys.executable, "-c", program], check=True)
