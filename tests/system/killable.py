"""Program that kills and resumes runs at random instants until they are finished.

Arguments: an experiment, a number of kills and a seed. Modules are imported once; each
attempt is a fork of this process that executes ``revolve run`` or ``resume`` without a
network. SIGKILL ends it after a random time, up to half of the time of a whole run.
When a run is finished, the next one begins. Times are CPU times, so the progress of an
attempt does not depend on the load of the machine. Prints the journal size at each
kill.
"""

import os
import signal
import sys
import time
from pathlib import Path

import numpy as np

from schema.agent.supervisor import prepare_process

prepare_process()

import analyzer.service  # noqa: E402, F401 - before the first fork
import worker.serve.service  # noqa: E402, F401
from coordinator.__main__ import main  # noqa: E402
from coordinator.storage.journal import NAME  # noqa: E402
from schema.tables.description import DETAILS  # noqa: E402

FLAGS = ["--in-process", "--threads", "1", "--quiet"]


def attempt(document: str, folder: Path, after_s: float) -> float | None:
    """Run or resume once; return its CPU time [s], or None if it was killed."""
    words = ["resume", str(folder)]
    if not (folder / DETAILS).exists():
        words = ["run", document, "--seed", "4", "--out", str(folder)]
    child = os.fork()
    if child == 0:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        os._exit(main([*words, *FLAGS]))
    spent_s = 0.0
    while spent_s < after_s:
        spent_s = time.clock_gettime(processor_clock(child))
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            assert status == 0, f"{words} ended with {status}"
            return spent_s
        time.sleep(0.0005)  # polling interval
    os.kill(child, signal.SIGKILL)
    _, status = os.waitpid(child, 0)
    return None if os.WIFSIGNALED(status) else spent_s


def processor_clock(process: int) -> int:
    """Return the Linux id of a process's CPU clock; see clock_getcpuclockid(3)."""
    return (~process << 3) | 2


def kill_runs(document: str, kills: int, seed: int) -> None:
    """Execute at least two runs with at least this number of kills in total."""
    rng = np.random.default_rng(seed)
    whole_s = attempt(document, Path("whole"), 1000.0)
    assert whole_s is not None
    run, killed = 0, 0
    while killed < kills or run < 2:
        folder = Path(f"run-{run}")
        while attempt(document, folder, rng.uniform(0.0, 0.5 * whole_s)) is None:
            killed += 1
            journal = folder / NAME
            size = journal.stat().st_size if journal.exists() else 0
            sys.stdout.write(f"{folder} killed at {size} bytes of its journal\n")
        run += 1


if __name__ == "__main__":
    kill_runs(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
