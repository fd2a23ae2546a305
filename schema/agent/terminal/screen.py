"""Whether this machine can show a viewer's window."""

import os
import sys

_VARIABLES = ("DISPLAY", "WAYLAND_DISPLAY")


def missing_screen() -> str:
    """Return why no window can be opened here; empty if there is a screen.

    Only Linux and other systems with X11 or Wayland can be without one.
    """
    if sys.platform in ("darwin", "win32") or any(map(os.environ.get, _VARIABLES)):
        return ""
    variables = " and ".join(f"${name}" for name in _VARIABLES)
    return f"no screen here ({variables} are not set)"
