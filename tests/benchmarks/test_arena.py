"""Benchmarks of the overhead of an arena over the physics of its robots.

Absolute speeds depend on the machine and are only printed. The tests check ratios that
are measured in each second of the same run.
"""

import math
import os
import sys

import numpy as np
import pytest

from analyzer.report import analyze
from coordinator.evolution.generation import generate
from schema.experiment.file import read_experiment
from schema.experiment.settings import arena_settings_of
from tests.benchmarks.arena_timing import (
    ArenaTiming,
    Stopwatch,
    even_places,
    time_arena,
)
from worker.bench.arena_bench import RobotSource
from worker.bench.arena_timing import insertions, quadratic_fit

EXPERIMENT = read_experiment("scenario3")
SETTINGS = arena_settings_of(EXPERIMENT)
BIRTH_S = 15
"""Seconds between two births of scenario 3, in an arena of 30."""


def measure(count: int, seconds: int, *, threads: int = 1, bare: bool) -> ArenaTiming:
    """Time an arena of random robots with births, at 30 robots per disc of 2 m."""
    radius_m = 2.0 * math.sqrt(count / 30)
    born = math.ceil(seconds * count / 30 / BIRTH_S)
    robots = RobotSource(generate, analyze).robots(
        EXPERIMENT, count + born, seed=3, is_vetted=True
    )
    rng = np.random.default_rng(3)
    places = even_places(rng, count, radius_m) + even_places(rng, born, radius_m)
    inserted = insertions(robots, places)
    found = time_arena(
        SETTINGS,
        inserted[:count],
        seconds=seconds,
        threads=threads,
        spares=inserted[count:],
        warm_up_s=2,
        measures_bare=bare,
    )
    report(
        f"{count} robots, {threads} thread(s): {found.factor:.2f} x real time, "
        f"{1000 * found.wall_s / seconds / count:.2f} ms per robot-second, "
        f"bare / arena {found.ratio:.3f}, "
        f"births, deaths, regrouping {100 * found.changing_s / found.wall_s:.2f} %, "
        f"checks for merges {100 * found.merging_s / found.wall_s:.2f} %, "
        f"{found.merges} merges, {found.splits} splits, largest {found.largest}"
    )
    return found


def report(line: str) -> None:
    sys.stdout.write(f"\n{line}")


def repeated_timings(count: int, seconds: int, least: float) -> list[ArenaTiming]:
    """Return up to three timings, because other load distorts ratios."""
    found: list[ArenaTiming] = []
    while len(found) < 3 and max((t.ratio for t in found), default=0.0) < least:
        found.append(measure(count, seconds, bare=True))
    return found


@pytest.mark.benchmark
@pytest.mark.slow
@pytest.mark.timeout(600)
def test_bare_steps_are_most_of_the_time_of_thirty_robots() -> None:
    """Bare steps take at least 0.75 of the time, births and deaths at most 0.03."""
    found = repeated_timings(30, 15, least=0.75)
    assert max(t.ratio for t in found) >= 0.75
    assert min(t.changing_s / t.wall_s for t in found) <= 0.03


@pytest.mark.benchmark
@pytest.mark.slow
@pytest.mark.timeout(600)
def test_time_per_robot_is_nearly_constant_at_constant_density() -> None:
    """Alternate two sizes, each relative to its own bare steps."""
    growths = []
    for _ in range(3):
        few, many = measure(20, 10, bare=True), measure(200, 2, bare=True)
        growths.append(few.ratio / many.ratio)
        if growths[-1] <= 1.2:
            break
    assert min(growths) <= 1.2


@pytest.mark.benchmark
@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.skipif((os.cpu_count() or 1) < 2, reason="needs two cores")
def test_two_threads_spend_at_least_0_6_of_the_time_on_bare_steps() -> None:
    """Targets of the printed factors: 30 robots: 10 and 18; 200: 3; 400: 1.

    Births are about as frequent as in scenario 3. Bare steps also run on two threads,
    at the same time of the run and under the same load.
    """
    ratios = []
    for _ in range(3):
        measure(30, BIRTH_S, threads=1, bare=False)
        ratios.append(measure(30, BIRTH_S, threads=2, bare=True).ratio)
        if ratios[-1] >= 0.6:
            break
    for count, seconds in ((200, 6), (400, 3)):
        measure(count, seconds, threads=2, bare=False)
    assert max(ratios) >= 0.6


def test_fit_recovers_the_coefficients_of_the_thesis() -> None:
    sizes = list(range(5, 51, 5))
    factors = [-0.26 + 34.78 / p + 20.41 / p**2 for p in sizes]
    assert quadratic_fit(sizes, factors) == pytest.approx([-0.26, 34.78, 20.41])


class Sleeper:
    """Object with a method of one second and a method of two seconds that calls it."""

    now = 0.0

    def short(self) -> None:
        self.now += 1.0

    def long(self) -> None:
        self.now += 1.0
        self.short()


def test_stopwatch_counts_nested_calls_once() -> None:
    sleeper = Sleeper()
    watch = Stopwatch(lambda: sleeper.now)
    watch.wrap(sleeper, "short", "long")
    sleeper.long()
    sleeper.short()
    assert watch.total_s == 3.0
