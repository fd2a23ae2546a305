"""Simulated archipelagos whose results are known in advance."""

from dataclasses import replace

import pytest

from tests.benchmarks.archipelago_model import Archipelago, ArchipelagoModel

EVEN = Archipelago(30, islands=2, groups=2, spread=1e-9, coordinator_s=1e-9)


def test_as_many_workers_as_births_at_a_time_are_all_busy() -> None:
    found = ArchipelagoModel(EVEN).run()
    assert found.workers == pytest.approx(1.0, abs=0.001)
    assert found.births_per_s == pytest.approx(30 / 0.04, rel=0.01)
    assert found.migration == pytest.approx(0.0, abs=0.001)


@pytest.mark.parametrize("groups", [1, 2, 4])
def test_coordinators_limit_the_rate(groups: int) -> None:
    slow = replace(EVEN, workers=300, islands=20, groups=groups, coordinator_s=0.01)
    found = ArchipelagoModel(slow).run()
    assert found.births_per_s == pytest.approx(100 * groups, rel=0.03)
    assert found.coordinators == pytest.approx(1.0, abs=0.03)


def test_a_slow_group_makes_its_neighbours_wait() -> None:
    """Of three groups one has two islands: its coordinator limits all four islands.

    Without migration the other two would be twice as fast.
    """
    uneven = replace(EVEN, workers=60, islands=4, groups=3, coordinator_s=0.1)
    bound, free = (
        ArchipelagoModel(replace(uneven, epoch=epoch)).run() for epoch in (15, 0)
    )
    assert bound.births_per_s == pytest.approx(20.0, rel=0.05)
    assert bound.migration == pytest.approx(0.25, abs=0.05)
    assert free.migration == 0.0
    assert free.births_per_s > 1.3 * bound.births_per_s
