"""Program that runs an experiment and kills it at random instants, until done.

Arguments: an experiment, a number of kills and a seed. Modules are imported once. Each
life is a fork of this process that does ``revolve run`` or ``resume`` without a
network. SIGKILL ends it after a drawn time, up to half the duration of a whole run.
After a run is finished the next one begins. Time is the CPU time of a life, so that
progress does not depend on other load. The program prints one line per kill: what was
on disk.
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
from coordinator.storage.folder import DETAILS  # noqa: E402
from coordinator.storage.journal import NAME  # noqa: E402

FLAGS = ["--in-process", "--threads", "1", "--quiet"]


def life(document: str, folder: Path, after_s: float) -> float | None:
    """Run one life; return its CPU time [s] if the run ended before the kill."""
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
        time.sleep(0.0005)  # the interval of looking
    os.kill(child, signal.SIGKILL)
    _, status = os.waitpid(child, 0)
    return None if os.WIFSIGNALED(status) else spent_s


def processor_clock(process: int) -> int:
    """Return the CPU clock of a process, as clock_getcpuclockid(3) numbers it."""
    return (~process << 3) | 2


def lives(document: str, kills: int, seed: int) -> None:
    """Repeat at least two runs, until a number of kills is reached."""
    rng = np.random.default_rng(seed)
    whole_s = life(document, Path("whole"), 1000.0)
    assert whole_s is not None
    run, killed = 0, 0
    while killed < kills or run < 2:
        folder = Path(f"run-{run}")
        while life(document, folder, rng.uniform(0.0, 0.5 * whole_s)) is None:
            killed += 1
            journal = folder / NAME
            size = journal.stat().st_size if journal.exists() else 0
            sys.stdout.write(f"{folder} killed at {size} bytes of its journal\n")
        run += 1


if __name__ == "__main__":
    lives(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
