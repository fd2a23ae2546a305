"""Platform tag: CPU class, system and libraries, which decide rounding.

Two machines with equal tags give equal results; others may.
"""

import platform
from collections.abc import Collection
from functools import cache
from pathlib import Path

from schema.agent.capacity import system_text
from schema.agent.version import VERSION, installed
from schema.wire.codec import format_digest
from schema.wire.messages import OF_AGENTS

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
