"""Thread pool of an arena."""

import threading

import pytest

from worker.arena.threads import ThreadTeam


@pytest.mark.parametrize("threads", [1, 2, 5])
@pytest.mark.parametrize("count", [0, 1, 3, 200])
def test_every_job_runs_once(threads: int, count: int) -> None:
    pool, done = ThreadTeam(threads), [0] * count

    def job(number: int) -> None:
        done[number] += 1

    for _ in range(3):
        pool.run([lambda number=number: job(number) for number in range(count)])  # type: ignore[misc]
    pool.close()
    assert done == [3] * count


def test_error_of_a_job_is_raised_and_the_pool_stays_usable() -> None:
    pool, done = ThreadTeam(2), []

    def bad() -> None:
        raise RuntimeError("engine")

    with pytest.raises(RuntimeError, match="engine"):
        pool.run([bad, lambda: done.append(1), lambda: done.append(2)])
    pool.run([lambda: done.append(3)] * 2)
    pool.close()
    assert sorted(done) == [1, 2, 3, 3]


def test_close_stops_the_threads() -> None:
    before, gate = threading.enumerate(), threading.Barrier(3)
    pool = ThreadTeam(3)

    def job() -> None:
        gate.wait(timeout=30)

    pool.run([job] * 3)
    others = [t for t in threading.enumerate() if t not in before]
    assert len(others) == 2
    pool.close()
    pool.close()
    for thread in others:
        thread.join(timeout=30)
        assert not thread.is_alive()
