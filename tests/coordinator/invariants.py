"""What holds of each state machine between two events, whatever happened before."""

from collections.abc import Callable
from itertools import pairwise
from typing import Any

from coordinator.arena.arena import Arena
from coordinator.dispatch.dispatch import Dispatch
from coordinator.dispatch.pool import Pending, Pool
from coordinator.islands.island import Island


def check_dispatch(dispatch: Dispatch) -> None:
    """Check that jobs, agents and homes of shards tell the same."""
    jobs, homes = dispatch._jobs, dispatch.homes
    for number, pending in jobs.items():
        assert pending.job.number == number
        pool = dispatch._pools["analyzer" if pending.job.kind == "breed" else "worker"]
        for name in pending.holders:
            agent = pool.agents[name]
            assert (agent.held | agent.advances)[number] is pending
        if pending.job.shard < 0:
            _check_waits(pending, pool)
        else:
            assert homes.shards[pending.job.shard].advance is pending
            assert number not in pool.waiting
    for number, pending in dispatch._earlier.items():
        assert number in pending.earlier
        assert jobs[pending.job.number] is pending
    for pool in dispatch._pools.values():
        assert pool.waiting.keys() <= jobs.keys()
        for name, agent in pool.agents.items():
            assert dispatch._pool_of[name] is pool
            assert agent.busy == min(len(agent.advances), agent.joined.slots)
    for home in homes.shards.values():
        assert {home.holder, home.successor} <= {"", *dispatch.workers.agents}
        assert not (home.has_state and not home.holder)
        if home.advance is not None:
            assert jobs[home.advance.job.number] is home.advance
            assert home.advance.holders.keys() <= {home.holder}


def _check_waits(pending: Pending, pool: Pool) -> None:
    """Check that a job waits if no agent works at it, and only then."""
    works = any(not pool.agents[name].is_silent for name in pending.holders)
    assert (pending.job.number in pool.waiting) != works


def check_island(island: Island) -> None:
    """Check that each birth is in one place, and that something is under way."""
    flight = island._in_flight
    assert 0 <= island.births <= island._begun <= island.experiment.births
    assert sorted(flight) == list(range(island.births, island._begun))
    births = [one.birth for one in island.population]
    assert len({*births}) == len(births)
    if island._begun and not (flight or island.is_finished):
        reevaluations, migration = island._reevaluations, island._migration
        assert migration or (reevaluations and reevaluations.is_open)


def check_arena(arena: Arena) -> None:
    """Check the living, and that something is under way unless an operator paused."""
    births = [one.birth for one in arena.population]
    assert all(a < b for a, b in pairwise(births))
    if arena._awaited is not None:
        assert arena.step < arena._awaited.until
        assert arena._awaited.number == arena._advances
        assert not arena.is_finished
    elif arena._has_started and not (arena.is_finished or arena._is_held):
        infancy, migration = arena._infancy, arena._migration
        assert (
            arena._breeding_queue.is_busy
            or (infancy and infancy.is_waiting)
            or (migration and migration.epochs.is_waiting)
        )


CHECKS: dict[type[Any], Callable[[Any], None]] = {
    Dispatch: check_dispatch,
    Island: check_island,
    Arena: check_arena,
}
