"""Versions of this package and of what decides its results."""

import platform
import subprocess
from pathlib import Path

from schema.agent.version import LIBRARIES, VERSION, installed

_ROOT = Path(__file__).resolve().parents[2]


def version_text() -> str:
    """Return the lines of ``revolve --version``; nothing large is imported."""
    libraries = ", ".join(
        f"{name} {installed(package) or 'not installed'}"
        for name, package in LIBRARIES.items()
    )
    return (
        f"revolve {VERSION}{_commit(_ROOT)}\n"
        f"Python {platform.python_version()}, {platform.system()} {platform.machine()}"
        f" {platform.release()}\n"
        f"{libraries}"
    )


def _commit(root: Path) -> str:
    """Return the commit of a git tree as text; empty if the folder is none."""
    if not (root / ".git").exists():
        return ""
    try:
        commit = subprocess.run(  # noqa: S603 - the user's git
            ["git", "-C", str(root), "describe", "--always", "--dirty"],  # noqa: S607 - the same
            capture_output=True,
            text=True,
            check=True,
        ).stdout.strip()
    except (OSError, subprocess.CalledProcessError):
        return ""
    return f" (commit {commit})"
