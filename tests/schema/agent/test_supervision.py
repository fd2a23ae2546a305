"""Cause of a process's death, as its supervisor finds it; use of CPU time by a job."""

import os
import signal
import sys
import threading
import time
from collections.abc import Callable
from multiprocessing import heap
from pathlib import Path

import pytest

from schema.agent.supervision import (
    CurrentJob,
    JobWatch,
    ProcessSlot,
    crash_cause,
    thread_clock,
)
from schema.agent.supervisor import ProcessPool
from schema.wire.messages import RunningJob

TASK = RunningJob("worker-0.ab", "host:some/folder", 3, 2**40, b"12345678")
PATIENCE_S = 30.0


@pytest.mark.parametrize(
    ("code", "doing"),
    [
        (-signal.SIGSEGV, "SIGSEGV"),
        (-signal.SIGABRT, "SIGABRT"),
        (-signal.SIGBUS, "SIGBUS"),
        (-signal.SIGFPE, "SIGFPE"),
        (-signal.SIGILL, "SIGILL"),
        (-signal.SIGPROF, "use of too much CPU time"),
        (3, "exit with status 3"),
        (0, "exit with status 0"),
        (-signal.SIGKILL, ""),
        (-signal.SIGTERM, ""),
        (-signal.SIGHUP, ""),
    ],
)
def test_only_some_exit_codes_are_crashes_by_the_job(code: int, doing: str) -> None:
    assert crash_cause(code) == doing


@pytest.mark.parametrize("limit_s", [2000.0, 1e10, 1e12, 1e300])
def test_a_job_is_noted_while_it_is_done_and_limited(limit_s: float) -> None:
    slot = ProcessSlot(0, CurrentJob())
    assert slot.note is not None
    with slot.doing(TASK, limit_s):
        assert slot.note.read() == TASK
        assert signal.getitimer(signal.ITIMER_PROF)[0] > 1000.0
    assert slot.note.read() is None
    assert signal.getitimer(signal.ITIMER_PROF)[0] == 0.0


@pytest.mark.parametrize(
    ("error", "is_noted"), [(ZeroDivisionError, False), (SystemExit, True)]
)
def test_exit_leaves_the_note_and_an_error_does_not(
    error: type[BaseException], is_noted: object
) -> None:
    slot = ProcessSlot(0, CurrentJob())
    with pytest.raises(error), slot.doing(TASK, 100.0):
        raise error
    assert slot.note is not None
    assert (slot.note.read() == TASK) is is_noted


def die(signal_number: int, log: str, slot: ProcessSlot) -> None:
    """Record the causes of earlier deaths; crash in a job at the first two starts."""
    with Path(log).open("a", encoding="utf-8") as file:
        file.write(f"{[death.cause for death in slot.deaths]}\n")
    if len(slot.deaths) < 2:
        with slot.doing(TASK, 100.0):
            os.kill(os.getpid(), signal_number)
            time.sleep(PATIENCE_S)


def until(process_pool: ProcessPool, is_enough: Callable[[], bool]) -> list[str]:
    """Look after a pool until a condition holds; return its lines."""
    end_s = time.monotonic() + PATIENCE_S
    lines: list[str] = []
    while not is_enough():
        assert time.monotonic() < end_s
        lines += process_pool.look_after()
        process_pool.wait(0.1)
    return lines


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_successor_is_told_which_jobs_crashed_its_slot(tmp_path: Path) -> None:
    log = tmp_path / "log"
    with ProcessPool(die, (signal.SIGSEGV, str(log)), size=1) as process_pool:
        told = until(process_pool, lambda: process_pool.exit_codes == [0])
    assert "SIGSEGV; it is restarted" in told[0]
    assert [f"died of job {TASK.number}" in line for line in told] == [
        True,
        True,
        False,
    ]
    lines = log.read_text().splitlines()
    assert lines == ["[]", "['SIGSEGV']", "['SIGSEGV', 'SIGSEGV']"]


def leave(how: str, slot: ProcessSlot) -> None:
    """End between two jobs, or wait to be killed."""
    assert slot.note is not None
    if how == "by an error":
        raise RuntimeError("the network's, not a job's")
    if how == "killed":
        time.sleep(PATIENCE_S)


@pytest.mark.slow
@pytest.mark.parametrize(("how", "code"), [("as asked", 0), ("by an error", 1)])
def test_process_that_exits_by_itself_is_restarted_later_each_time(
    how: str, code: int
) -> None:
    """Restarts after 1 s, then 2 s: the cause may recur."""
    began_s = time.monotonic()
    with ProcessPool(leave, (how,), size=1, role="analyzer") as process_pool:
        for _ in range(2):
            (line,) = until(process_pool, lambda: process_pool.exit_codes == [code])
            assert line.startswith("an analyzer process ended outside a job, ")
            assert until(process_pool, lambda: process_pool.exit_codes == []) == []
        assert time.monotonic() - began_s > 3.0


def work(folder: str, slot: ProcessSlot) -> None:
    """Do a job that never ends, and note the number of crashes so far."""
    assert slot.note is not None
    slot.note.begin(TASK)
    Path(folder, f"{os.getpid()}").write_text(f"{os.getppid()} {len(slot.deaths)}")
    time.sleep(PATIENCE_S)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform != "linux", reason="others spawn processes")
def test_forks_end_with_their_server_and_no_job_is_blamed(tmp_path: Path) -> None:
    def known() -> list[Path]:
        return [one for one in tmp_path.iterdir() if one.read_text()]

    with ProcessPool(work, (str(tmp_path),), size=2) as process_pool:
        until(process_pool, lambda: len(known()) == 2)
        first = known()
        (server,) = {int(one.read_text().split()[0]) for one in first}
        os.kill(server, signal.SIGKILL)
        until(process_pool, lambda: len(known()) == 4)
        assert {one.read_text().split()[1] for one in known()} == {"0"}
        # The command line of a process that has ended is empty until it is waited for.
        lines = [Path("/proc", one.name, "cmdline") for one in first]
        assert not any(line.exists() and line.read_bytes() for line in lines)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_the_user_is_told_once_of_a_process_that_was_killed() -> None:
    with ProcessPool(leave, ("killed",), size=1) as process_pool:
        (killed,) = process_pool._processes
        assert killed.pid is not None
        os.kill(killed.pid, signal.SIGKILL)
        told = until(process_pool, lambda: killed not in process_pool._processes)
        assert told == ["a worker process ended; it is restarted"]
        assert process_pool.look_after() == []


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


def test_each_job_starts_anew_and_nothing_is_quiet_between_jobs(
    clocks: Clocks, watch: JobWatch
) -> None:
    passed(clocks, watch, 10, 0.0)
    assert [watch.task, watch.quiet_s] == [None, None]
    watch.begin(TASK)
    assert watch.task == TASK
    passed(clocks, watch, 60, 0.0)
    watch.end()
    assert [watch.task, watch.quiet_s] == [None, None]
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


def test_a_note_needs_no_shared_memory_of_the_system(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """In some containers ``/dev/shm`` is missing or cannot be written."""
    monkeypatch.setattr(heap.BufferWrapper, "_heap", heap.Heap())
    monkeypatch.setattr(heap.Arena, "_dir_candidates", ["/nowhere"])
    monkeypatch.setattr("os.access", lambda *_: False)
    note = CurrentJob()
    # Names longer than those of ours are cut.
    note.begin(RunningJob("a" * 999, "r" * 9999, 1, 2))
    held = note.read()
    assert held is not None
    assert (held.agent, held.number) == ("a" * 255, 2)
    assert "r" * 1000 in held.run
