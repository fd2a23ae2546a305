"""A program: runs that are killed at random instants, again and again, until done.

Run with an experiment, a number of kills and a seed. All is imported once; each life
is a fork of this process that does ``revolve run`` or ``resume`` without a network
and dies of SIGKILL after a drawn time, up to half of what a whole run takes, until
the run is done; then the next one begins. Prints a line per kill, what stood on disk.
"""

import os
import signal
import sys
import time
from pathlib import Path

import numpy as np

from schema.crew import one_thread_each

one_thread_each()

import analyzer.service  # noqa: E402, F401 - before the first fork
import worker.service  # noqa: E402, F401
from coordinator.__main__ import main  # noqa: E402
from coordinator.folder import DETAILS  # noqa: E402
from coordinator.journal import NAME  # noqa: E402

FLAGS = ["--in-process", "--threads", "1", "--quiet"]


def life(document: str, folder: Path, after_s: float) -> bool:
    """Live once; return whether the run came to its end before its time."""
    words = ["resume", str(folder)]
    if not (folder / DETAILS).exists():
        words = ["run", document, "--seed", "4", "--out", str(folder)]
    child = os.fork()
    if child == 0:
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        os._exit(main([*words, *FLAGS]))
    end_s = time.monotonic() + after_s
    while time.monotonic() < end_s:
        done, status = os.waitpid(child, os.WNOHANG)
        if done:
            assert status == 0, f"{words} ended with {status}"
            return True
        time.sleep(0.0005)  # the interval of looking
    os.kill(child, signal.SIGKILL)
    _, status = os.waitpid(child, 0)
    return not os.WIFSIGNALED(status)


def lives(document: str, kills: int, seed: int) -> None:
    """Run, and kill so often."""
    rng = np.random.default_rng(seed)
    began_s = time.monotonic()
    assert life(document, Path("whole"), 1000.0)
    whole_s = time.monotonic() - began_s
    run, killed = 0, 0
    while killed < kills:
        folder = Path(f"run-{run}")
        while not life(document, folder, rng.uniform(0.0, 0.5 * whole_s)):
            killed += 1
            journal = folder / NAME
            size = journal.stat().st_size if journal.exists() else 0
            sys.stdout.write(f"{folder} killed at {size} bytes of its journal\n")
        run += 1


if __name__ == "__main__":
    lives(sys.argv[1], int(sys.argv[2]), int(sys.argv[3]))
