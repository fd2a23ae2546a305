"""Versions of Revolve Islands, which pyproject.toml takes from here, and libraries."""

from importlib.metadata import PackageNotFoundError, version

VERSION = "0.3.0"
LIBRARIES = {
    "MuJoCo": "mujoco-core",
    "Zenoh": "eclipse-zenoh",
    "Arrow": "pyarrow",
    "NumPy": "numpy",
    "Protobuf": "protobuf",
}
"""Distributions that decide results, tables and messages, by name."""


def installed(distribution: str) -> str | None:
    """Return the version of a distribution; None if it is missing."""
    try:
        return version(distribution)
    except PackageNotFoundError:
        return None
