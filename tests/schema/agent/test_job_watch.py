"""The watch over a job: whether it uses CPU time."""

import threading
import time

import pytest

from schema.agent.job_watch import JobWatch, thread_clock
from schema.agent.supervision import Task

TASK = Task("a", "run", 1, 2)


class Clocks:
    """Wall time and CPU time, set by the test [s]."""

    now_s = 100.0
    cpu_s = 7.0


@pytest.fixture
def clocks() -> Clocks:
    return Clocks()


@pytest.fixture
def watch(clocks: Clocks) -> JobWatch:
    return JobWatch(lambda: clocks.cpu_s, lambda: clocks.now_s)


def passed(clocks: Clocks, watch: JobWatch, seconds: int, used_s: float) -> None:
    """Let time pass, with a measurement each second."""
    for _ in range(seconds):
        clocks.now_s += 1.0
        clocks.cpu_s += used_s / seconds
        watch.measure()


def test_nothing_is_quiet_between_jobs(clocks: Clocks, watch: JobWatch) -> None:
    passed(clocks, watch, 10, 0.0)
    assert watch.quiet_s is None
    watch.begin(TASK)
    assert watch.task == TASK
    assert watch.quiet_s == pytest.approx(0.0)
    watch.end()
    passed(clocks, watch, 10, 5.0)
    assert [watch.task, watch.quiet_s] == [None, None]


@pytest.mark.parametrize(
    ("used_s", "quiet_s"),
    # A loop that polls needs some thousandth of a core; a process on a machine with
    # a load of two hundred per core gets five.
    [(0.0, 60.0), (60 * 0.001, 60.0), (60 * 0.005, 0.0), (60.0, 0.0)],
)
def test_job_is_quiet_while_it_uses_no_cpu(
    clocks: Clocks, watch: JobWatch, used_s: float, quiet_s: float
) -> None:
    watch.begin(TASK)
    passed(clocks, watch, 60, used_s)
    assert watch.quiet_s == quiet_s


def test_each_job_starts_anew(clocks: Clocks, watch: JobWatch) -> None:
    watch.begin(TASK)
    passed(clocks, watch, 60, 0.0)
    watch.end()
    watch.begin(TASK)
    passed(clocks, watch, 3, 0.0)
    assert watch.quiet_s == 3.0


def test_clock_of_a_thread_counts_its_own_work_only() -> None:
    clock = thread_clock(threading.get_ident())
    begun_s = clock()

    def work() -> None:
        until_s = time.thread_time() + 0.2
        while time.thread_time() < until_s:
            pass

    thread = threading.Thread(target=work)
    thread.start()
    thread.join()
    assert clock() - begun_s < 0.1
    work()
    assert clock() - begun_s >= 0.2
