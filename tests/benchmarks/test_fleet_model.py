"""Simulated fleets whose results are known in advance."""

from dataclasses import replace

import pytest

from tests.benchmarks.fleet_model import FleetModel, Setting, most_workers

FREE = Setting(workers=20, evaluation_s=1.0, coordinator_s=1e-9, latency_s=0.0)


def test_a_coordinator_without_cost_keeps_all_workers_busy() -> None:
    outcome = FleetModel(FREE).run()
    assert outcome.utilisation == pytest.approx(1.0, abs=0.02)
    assert outcome.births_per_s == pytest.approx(20.0, rel=0.02)


def test_a_saturated_coordinator_limits_the_rate() -> None:
    """20 workers could do 20 evaluations per second; the coordinator handles 10."""
    outcome = FleetModel(replace(FREE, coordinator_s=0.1)).run()
    assert outcome.coordinator == pytest.approx(1.0, abs=0.001)
    assert outcome.births_per_s == pytest.approx(10.0, rel=0.01)
    assert outcome.utilisation == pytest.approx(0.5, rel=0.03)


def test_waiting_for_a_job_costs_a_round_trip() -> None:
    """A round trip of 0.8 s hides behind a queued job of 1 s, but not of 0.1 s."""
    still = replace(FREE, workers=1, credits=2, spread=1e-9, latency_s=0.4)
    assert FleetModel(still).run().utilisation == pytest.approx(1.0, abs=0.01)
    quick = replace(still, evaluation_s=0.1)
    # Two answers per cycle of one evaluation and the way back and forth.
    assert FleetModel(quick).run().utilisation == pytest.approx(0.2 / 0.9, rel=0.02)


def test_work_of_lost_workers_is_lost() -> None:
    """Each loss costs half an evaluation: 2 losses per s, 20 workers, 1 s each."""
    outcome = FleetModel(replace(FREE, losses_per_s=2.0)).run()
    assert outcome.lost > 100
    assert outcome.utilisation == pytest.approx(1.0 - 0.05, abs=0.03)


def test_the_limit_is_found() -> None:
    """At 1 ms per birth and 0.1 s per evaluation, 100 / 0.95 workers are 95 % busy."""
    workers, outcome = most_workers(replace(FREE, evaluation_s=0.1, coordinator_s=1e-3))
    assert 95 <= workers <= 108
    assert outcome.utilisation >= 0.95
