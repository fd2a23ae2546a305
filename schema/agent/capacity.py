"""Cores and memory that a process may use, and how many arenas it can keep."""

import math
import os
from pathlib import Path

SHARD_BYTES = 64 * 2**20
"""Memory of an arena's state [bytes]: some 60 robots of 1 MiB each (measured)."""
MOST_SHARDS = 1000
_SHARE = 0.5
"""Share of the memory that the states may take together."""
_ROOT = Path("/sys/fs/cgroup")
_OWN = Path("/proc/self/cgroup")


def group_numbers(*names: str) -> list[list[int]]:
    """Return the numbers in these files of each control group of this process.

    Groups of version 1 and 2 count, and their parents: in a container the limits are
    at the root. A group in which one is missing, or no number, does not.
    """
    numbers = []
    for line in system_text(_OWN).splitlines():
        _, controllers, path = line.split(":", 2)
        group = _ROOT / controllers / path.lstrip("/")
        for each in (group, *group.parents):
            texts = [system_text(each / name) for name in names]
            words = " ".join(texts).split()
            if all(texts) and all(map(str.isdecimal, words)):
                numbers.append([int(word) for word in words])
    return numbers


def core_quota() -> float:
    """Return the cores' worth of time that control groups allow; inf: no limit."""
    limits = group_numbers("cpu.max")
    limits += group_numbers("cpu.cfs_quota_us", "cpu.cfs_period_us")
    return min((quota / period for quota, period in limits), default=math.inf)


def memory_bytes() -> int:
    """Return the memory of this machine or, if that is less, of its container."""
    memory = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    limits = group_numbers("memory.max") + group_numbers("memory.limit_in_bytes")
    return min([memory, *(limit for (limit,) in limits)])


def system_text(file: Path) -> str:
    """Return the text of a system file; empty if there is none."""
    try:
        return file.read_text("utf-8", errors="replace")
    except OSError:
        return ""


def shards_that_fit(memory: int, processes: int) -> int:
    """Return how many arenas each of several processes can keep in a memory [bytes]."""
    fit = int(_SHARE * memory) // (SHARD_BYTES * processes)
    return max(1, min(fit, MOST_SHARDS))
