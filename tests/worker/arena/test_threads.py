"""Threads that share out jobs."""

import threading

import pytest

from worker.arena.threads import Pool


@pytest.mark.parametrize("threads", [1, 2, 5])
@pytest.mark.parametrize("count", [0, 1, 3, 200])
def test_every_job_is_done_once(threads: int, count: int) -> None:
    pool, done = Pool(threads), [0] * count

    def job(number: int) -> None:
        done[number] += 1

    for _ in range(3):
        pool.run([lambda number=number: job(number) for number in range(count)])  # type: ignore[misc]
    pool.close()
    assert done == [3] * count


def test_the_threads_work_at_the_same_time() -> None:
    """Three jobs that wait for each other end only if three threads do them."""
    pool, gate = Pool(3), threading.Barrier(3)

    def job() -> None:
        gate.wait(timeout=30)

    pool.run([job] * 3)
    pool.close()


def test_what_a_job_raises_reaches_the_caller_and_the_pool_lives_on() -> None:
    pool, done = Pool(2), []

    def bad() -> None:
        raise RuntimeError("engine")

    with pytest.raises(RuntimeError, match="engine"):
        pool.run([bad, lambda: done.append(1), lambda: done.append(2)])
    pool.run([lambda: done.append(3)] * 2)
    pool.close()
    assert sorted(done) == [1, 2, 3, 3]


def test_a_pool_needs_a_thread() -> None:
    with pytest.raises(ValueError, match="got 0"):
        Pool(0)


def test_closed_threads_end() -> None:
    before = threading.enumerate()
    pool = Pool(3)
    others = [t for t in threading.enumerate() if t not in before]
    assert len(others) == 2
    pool.close()
    pool.close()
    for thread in others:
        thread.join(timeout=30)
        assert not thread.is_alive()
