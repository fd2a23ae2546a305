"""What the checks need to know of this machine, read from it."""

import os
import platform
import subprocess
import sys
from importlib import metadata
from importlib.util import find_spec
from pathlib import Path

from schema.agent.platform_tag import our_version, wire_version
from schema.plugins.permission import GROUP

_LIBRARIES = {
    "MuJoCo": "mujoco-core",
    "Zenoh": "eclipse-zenoh",
    "Arrow": "pyarrow",
    "NumPy": "numpy",
    "Protobuf": "protobuf",
}
# In a process of its own: a broken driver may end it.
_RENDER = """
import sys
from analysis.render.stage import choose_engine
engine = choose_engine()
if engine == "disable":
    print("ray casting: neither EGL nor OSMesa is installed")
    sys.exit()
import mujoco
context = mujoco.GLContext(64, 64)
context.make_current()
context.free()
print(engine)
"""


def versions() -> dict[str, str | None]:
    """Return the version of each package, None for those that are missing."""
    found: dict[str, str | None] = {
        "Revolve Islands": our_version(),
        "messages": wire_version().partition("+")[2],
    }
    for name, package in _LIBRARIES.items():
        try:
            found[name] = metadata.version(package)
        except metadata.PackageNotFoundError:
            found[name] = None
    return {**found, "Python": platform.python_version()}


def available_bytes(meminfo: Path = Path("/proc/meminfo")) -> int | None:
    """Return the memory that programs can get [bytes]; None if it is unknown."""
    for line in _text(meminfo).splitlines():
        key, _, value = line.partition(":")
        if key == "MemAvailable" and value.split()[:1]:
            return int(value.split()[0]) * 1024
    return None


def core_quota(group: Path | None) -> float | None:
    """Return the cores' worth of time of a control group (version 2); None: no limit.

    Args:
        group: folder of the group, see ``control_group``.
    """
    words = _text(group / "cpu.max").split() if group else []
    if len(words) == 2 and all(word.isdecimal() for word in words):  # noqa: PLR2004 - quota and period
        return int(words[0]) / int(words[1])
    return None


def group_bytes(group: Path | None) -> int | None:
    """Return the memory that a control group leaves [bytes]; None: no limit."""
    if group is None:
        return None
    limit, used = (
        _text(group / f"memory.{name}").strip() for name in ("max", "current")
    )
    if limit.isdecimal() and used.isdecimal():
        return max(0, int(limit) - int(used))
    return None


def control_group(
    root: Path = Path("/sys/fs/cgroup"), own: Path = Path("/proc/self/cgroup")
) -> Path | None:
    """Return the folder of this process's control group; None without version 2."""
    for line in _text(own).splitlines():
        number, _, path = line.split(":", 2)
        if number == "0":
            # In a container the path is that of the host, the limits are at the root.
            group = root / path.lstrip("/")
            return group if (group / "cpu.max").is_file() else root
    return None


def display() -> str:
    """Return the name of the screen, empty without one."""
    if sys.platform in {"darwin", "win32"}:
        return sys.platform
    return os.environ.get("WAYLAND_DISPLAY") or os.environ.get("DISPLAY") or ""


def plugin_modules() -> dict[str, bool]:
    """Return the modules of installed plug-ins, and whether each is there.

    None is imported, not even a parent package.
    """
    points = metadata.entry_points(group=GROUP)
    return {
        point.module: find_spec(point.module.partition(".")[0]) is not None
        for point in points
    }


def start_rendering() -> "subprocess.Popen[str]":
    """Start a process that renders nothing, as ``revolve robot render`` would."""
    paths = os.pathsep.join(path for path in sys.path if path)
    return subprocess.Popen(  # noqa: S603 - our own code
        [sys.executable, "-P", "-c", _RENDER],
        stdin=subprocess.DEVNULL,
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
        env={**os.environ, "PYTHONPATH": paths},
    )


def end_rendering(
    process: "subprocess.Popen[str]", timeout_s: float
) -> tuple[int | None, str]:
    """Return exit code and last line of a rendering process.

    Args:
        process: is killed if it does not end in time.
        timeout_s: how long to wait for it [s].

    Returns:
        The code, None if it did not end in time; the line may be empty.
    """
    try:
        output, _ = process.communicate(timeout=timeout_s)
    except subprocess.TimeoutExpired:
        process.kill()
        process.communicate()
        return None, ""
    lines = output.strip().splitlines()
    return process.returncode, lines[-1] if lines else ""


def _text(file: Path) -> str:
    """Return the text of a system file; empty if there is none."""
    try:
        return file.read_text("utf-8", errors="replace")
    except OSError:
        return ""
