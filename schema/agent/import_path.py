"""Imports and graphics that must not depend on where a process runs.

``python -m`` and ``python -c``, which starts spawned processes, search the current
folder first. A file ``random.py`` of the user there would replace the module of the
standard library, so children search where their parent does.
"""

import os
import sys
from importlib import import_module
from pathlib import Path

from schema.agent.log import warn_user
from schema.errors import one_line

GRAPHICS = "MUJOCO_GL"
"""Environment variable: graphics library that MuJoCo loads when it is imported."""
NO_GRAPHICS = "disable"
SAFE_PATH = "PYTHONSAFEPATH"
"""Environment variable: if set, Python does not import from the current folder."""


def python_command(module: str) -> list[str]:
    """Return the start of a command that runs a module in a process of its own."""
    return [sys.executable, "-P", "-m", module]


def environment() -> dict[str, str]:
    """Return the environment of children, which import what this process can."""
    paths = [str(Path(path).absolute()) for path in sys.path]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(dict.fromkeys(paths))}


def check_graphics() -> None:
    """Turn graphics off if MuJoCo cannot be imported with the library that is set."""
    chosen = os.environ.get(GRAPHICS)
    if chosen and chosen != NO_GRAPHICS:
        try:
            import_module("mujoco")
        except Exception as error:  # noqa: BLE001 - which one depends on the library
            os.environ[GRAPHICS] = NO_GRAPHICS
            warn_user(f"{GRAPHICS}={chosen} does not work: {one_line(error)}")


_VARIABLES = ("DISPLAY", "WAYLAND_DISPLAY")


def missing_screen() -> str:
    """Return why no window can be opened here; empty if there is a screen.

    Only Linux and other systems with X11 or Wayland can be without one.
    """
    if sys.platform in ("darwin", "win32") or any(map(os.environ.get, _VARIABLES)):
        return ""
    variables = " and ".join(f"${name}" for name in _VARIABLES)
    return f"no screen here ({variables} are not set)"
