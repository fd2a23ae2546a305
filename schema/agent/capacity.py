"""Number of arenas whose state a process can keep, from the memory of its machine."""

import os
from pathlib import Path

SHARD_BYTES = 64 * 2**20
"""Memory of an arena's state [bytes]: some 60 robots of 1 MiB each (measured)."""
MOST_SHARDS = 1000
_SHARE = 0.5
"""Share of the memory that the states may take together."""
_LIMIT = Path("/sys/fs/cgroup/memory.max")


def memory_bytes(limit: Path = _LIMIT) -> int:
    """Return the memory of this machine or, if that is less, of its container.

    Args:
        limit: file with the container's limit; it may be missing.
    """
    memory = os.sysconf("SC_PHYS_PAGES") * os.sysconf("SC_PAGE_SIZE")
    try:
        return min(memory, int(limit.read_text("ascii")))
    except (OSError, ValueError):
        return memory  # there is no limit, or it is "max"


def shards_that_fit(memory: int, processes: int) -> int:
    """Return how many arenas each of several processes can keep, at least one.

    Args:
        memory: of the machine [bytes].
        processes: that share it.
    """
    fit = int(_SHARE * memory) // (SHARD_BYTES * processes)
    return max(1, min(fit, MOST_SHARDS))
