"""Versions of this package and of what decides its results."""

import platform
import subprocess
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path

from schema.agent.version import VERSION

_LIBRARIES = {
    "mujoco": "mujoco-core",
    "zenoh": "eclipse-zenoh",
    "pyarrow": "pyarrow",
    "numpy": "numpy",
}
_ROOT = Path(__file__).resolve().parents[2]


def version_text() -> str:
    """Return the lines of ``revolve --version``; nothing large is imported."""
    libraries = ", ".join(f"{name} {_of(dist)}" for name, dist in _LIBRARIES.items())
    return (
        f"revolve {VERSION}{_commit(_ROOT)}\n"
        f"Python {platform.python_version()}, {platform.system()} {platform.machine()}"
        f" {platform.release()}\n"
        f"{libraries}"
    )


def _of(distribution: str) -> str:
    try:
        return version(distribution)
    except PackageNotFoundError:
        return "not installed"


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
