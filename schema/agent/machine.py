"""Capacity of this machine, and its platform tag, which decides rounding.

Two machines with equal tags give equal results; others may.
"""

import math
import os
import platform
from collections.abc import Collection
from functools import cache
from pathlib import Path

from schema.agent.version import VERSION, installed
from schema.wire.codec import format_digest
from schema.wire.messages import OF_AGENTS

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


MEANING = 0
"""Number of changes in the meaning of messages whose format stayed the same."""
# x86-64 psABI levels, by which compilers and libraries choose their code; each level
# includes those before it.
_LEVELS = {
    "v2": {"cx16", "lahf_lm", "popcnt", "pni", "sse4_1", "sse4_2", "ssse3"},
    "v3": {"abm", "avx", "avx2", "bmi1", "bmi2", "f16c", "fma", "movbe", "xsave"},
    "v4": {"avx512bw", "avx512cd", "avx512dq", "avx512f", "avx512vl"},
}


def platform_tag() -> str:
    """Return this process's tag, such as ``linux-x86_64_v3-glibc2.36-mujoco...``."""
    system = platform.system().lower()
    machine = cpu_class(platform.machine().lower(), cpu_flags(Path("/proc/cpuinfo")))
    library, number = platform.libc_ver()
    numpy = installed("numpy") or "0"
    mujoco = installed("mujoco-core") or "0"
    # Without the name of a C library, use the release of the system.
    library = f"{library}{number}" if library else platform.release()
    return f"{system}-{machine}-{library}-mujoco{mujoco}-numpy{numpy}"


@cache
def wire_version() -> str:
    """Return this project's version and, after a ``+``, that of its messages."""
    return f"{VERSION}+{format_digest(*OF_AGENTS)}.{MEANING}"


def cpu_class(machine: str, flags: Collection[str]) -> str:
    """Return the architecture and its level."""
    reached = machine
    if machine in {"x86_64", "amd64"}:
        reached = "x86_64_v1"
        for level, needed in _LEVELS.items():
            if not needed <= set(flags):
                break
            reached = f"x86_64_{level}"
    return reached


def cpu_flags(cpuinfo: Path) -> frozenset[str]:
    """Return the features of the first CPU of Linux's list; empty without a list."""
    for line in system_text(cpuinfo).splitlines():
        key, _, value = line.partition(":")
        if key.strip().lower() in {"flags", "features"}:
            return frozenset(value.split())
    return frozenset()
