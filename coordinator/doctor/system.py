"""What the checks need to know of this machine, read from it."""

import platform
import subprocess
import sys
from pathlib import Path

from schema.agent.import_path import environment
from schema.agent.machine import group_numbers, system_text, wire_version
from schema.agent.version import LIBRARIES, VERSION, installed

# In a process of its own: a broken driver may end it.
_RENDER = """
import sys
from analysis.render.stage import choose_engine
engine = choose_engine()
if engine == "disable":
    print("ray casting: neither EGL nor OSMesa works")
    sys.exit()
import mujoco
context = mujoco.GLContext(64, 64)
context.make_current()
context.free()
print(engine)
"""


def versions() -> dict[str, str | None]:
    """Return the version of each package, None for those that are missing."""
    return {
        "Revolve Islands": VERSION,
        "messages": wire_version().partition("+")[2],
        **{name: installed(package) for name, package in LIBRARIES.items()},
        "Python": platform.python_version(),
    }


def available_bytes(meminfo: Path = Path("/proc/meminfo")) -> int | None:
    """Return the memory that programs can get [bytes]; None if it is unknown."""
    for line in system_text(meminfo).splitlines():
        key, _, value = line.partition(":")
        if key == "MemAvailable" and value.split()[:1]:
            return int(value.split()[0]) * 1024
    return None


def group_bytes() -> int | None:
    """Return the memory that control groups leave [bytes]; None: no limit."""
    known = group_numbers("memory.max", "memory.current")
    known += group_numbers("memory.limit_in_bytes", "memory.usage_in_bytes")
    return min((max(0, limit - used) for limit, used in known), default=None)


def start_rendering() -> "subprocess.Popen[str]":
    """Start a process that renders nothing, as ``revolve robot render`` would."""
    return subprocess.Popen(  # noqa: S603 - our own code
        [sys.executable, "-P", "-c", _RENDER],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env=environment(),
    )


def end_rendering(
    process: "subprocess.Popen[str]", timeout_s: float
) -> tuple[int | None, str]:
    """Return exit code, None if there is none yet, and last line of a process."""
    try:
        output, _ = process.communicate(timeout=timeout_s)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
        return None, ""
    lines = output.strip().splitlines()
    return process.returncode, lines[-1] if lines else ""
