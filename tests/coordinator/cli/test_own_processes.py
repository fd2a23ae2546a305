"""Supervision of the processes that a run starts."""

import os
import signal
import sys
import time

import pytest

from coordinator.cli.main_loop import OwnProcesses
from schema.agent.supervision import ProcessSlot
from schema.agent.supervisor import ProcessPool

PATIENCE_S = 60.0


def wait(slot: ProcessSlot) -> None:
    """Wait to be killed, or exit at once in slot 1."""
    if slot.index == 0:
        time.sleep(PATIENCE_S)


@pytest.mark.slow
@pytest.mark.skipif(sys.platform == "win32", reason="signals of POSIX")
def test_the_user_is_told_once_of_each_process_that_was_killed(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with (
        ProcessPool(wait, (), size=1) as analyzers,
        ProcessPool(wait, (), size=1) as workers,
    ):
        processes = OwnProcesses({"analyzer": analyzers, "worker": workers})
        processes.look_after()
        assert not capsys.readouterr().err
        first = (workers, "a worker")
        for pool, name in (first, (analyzers, "an analyzer"), first):
            (pid,) = pool.pids
            os.kill(pid, signal.SIGKILL)
            until_s = time.monotonic() + PATIENCE_S
            while pool.pids in ([], [pid]):
                assert time.monotonic() < until_s
                processes.look_after()
                time.sleep(0.05)
            processes.look_after()
            lines = capsys.readouterr().err.splitlines()
            assert lines == [f"{name} process ended and is restarted"]
        assert (workers.losses, workers.exits, workers.restarts) == (2, 0, 2)


@pytest.mark.slow
def test_a_process_that_exits_by_itself_is_no_killed_one(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with ProcessPool(wait, (), size=2) as workers:
        processes = OwnProcesses({"worker": workers})
        until_s = time.monotonic() + PATIENCE_S
        while not workers.exits:
            assert time.monotonic() < until_s
            processes.look_after()
            time.sleep(0.05)
        assert workers.losses == 0
    (line,) = capsys.readouterr().err.splitlines()
    assert "ended outside a job, for the reason that it wrote above" in line
