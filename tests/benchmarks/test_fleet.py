"""Cost of a fleet from Python against the same evaluations in a run.

Both include the start and the end of all processes. The run also mates, vets, and
writes journal and tables; the fleet is given the robots that the run has made.
"""

import resource
import time
from collections.abc import Callable
from pathlib import Path
from typing import TypeVar

import pytest

import revolve as rv

pytestmark = pytest.mark.benchmark

T = TypeVar("T")

ROBOTS = 1000
WORKERS = 2
MOST = 1.1


def costs(act: Callable[[], T]) -> tuple[T, float, float]:
    """Return what a function returns, its duration and the CPU time of it all [s]."""
    wall_s, cpu_s = time.perf_counter(), _cpu_s()
    found = act()
    return found, time.perf_counter() - wall_s, _cpu_s() - cpu_s


def _cpu_s() -> float:
    used = map(resource.getrusage, (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN))
    return sum(each.ru_utime + each.ru_stime for each in used)


def _in_fleet(robots: list[rv.Robot]) -> list[rv.Result]:
    with rv.Fleet(workers=WORKERS) as fleet:
        return list(fleet.evaluate(robots, "no-reproduction"))


def test_fleet_costs_little_more_than_a_run(tmp_path: Path) -> None:
    run, run_s, run_cpu_s = costs(
        lambda: rv.run(
            "no-reproduction",
            seed=1,
            births=ROBOTS,
            workers=WORKERS,
            out=tmp_path / "run",
        )
    )
    robots = run.robots(run.births.sort_by("birth"))
    results, fleet_s, fleet_cpu_s = costs(lambda: _in_fleet(robots))
    print(
        f"{ROBOTS} evaluations on {WORKERS} workers: in a run {run_s:.1f} s "
        f"({run_cpu_s:.1f} s CPU), by Fleet.evaluate {fleet_s:.1f} s "
        f"({fleet_cpu_s:.1f} s CPU): {fleet_s / run_s:.2f} times "
        f"({fleet_cpu_s / run_cpu_s:.2f} times); required: {MOST}"
    )
    rows = run.evaluations.sort_by("birth").to_pylist()
    assert [row["fitness"] for row in rows] == [result.fitness for result in results]
    assert fleet_s <= MOST * run_s
