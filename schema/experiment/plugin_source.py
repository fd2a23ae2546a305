"""Digests of plug-ins, to check that two machines have the same code.

The digest covers the source files of a plug-in's top-level module or package. The
packages of this project are not plug-ins; their version identifies them.
"""

import re
from functools import lru_cache
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path

from schema.errors import PluginDiffers

_ROOMS = ("schema", "coordinator", "worker", "analyzer", "analysis")
_PATH = re.compile(r'"([A-Za-z_]\w*)(?:\.[A-Za-z_]\w*)*:[A-Za-z_]\w*"')
_DIGITS = 12


@lru_cache(maxsize=64)
def plugins_of(settings: bytes) -> str:
    """Return the plug-ins that settings name, with their digests on this machine.

    Args:
        settings: JSON; every text in it like ``module:attribute`` names a plug-in.

    Returns:
        ``module=digest`` for each top-level module, by name, with a space between.
    """
    named = set(_PATH.findall(settings.decode(errors="replace")))
    modules = sorted(named.difference(_ROOMS))
    return " ".join(f"{name}={_digest(name)}" for name in modules)


@lru_cache(maxsize=64)
def check_plugins(wanted: str) -> None:
    """Raise unless this machine has the same plug-ins.

    Args:
        wanted: the result of ``plugins_of`` on the other machine.

    Raises:
        PluginDiffers: one is missing, or its source differs.
    """
    for each in wanted.split():
        name, _, digest = each.partition("=")
        found = _digest(name)
        if not found:
            raise PluginDiffers(f"has no plug-in {name!r}")
        if found != digest:
            raise PluginDiffers(
                f"its plug-in {name!r} differs from the coordinator's: source digest "
                f"{found}, expected {digest}"
            )


@lru_cache(maxsize=64)
def _digest(module: str) -> str:
    """Return the digest of a top-level module's source; empty if not installed."""
    try:
        spec = find_spec(module)
    except (ImportError, ValueError):
        return ""
    if spec is None:
        return ""
    hashed = sha256()
    if spec.submodule_search_locations:
        for folder in spec.submodule_search_locations:
            for file in sorted(Path(folder).rglob("*.py")):
                hashed.update(file.relative_to(folder).as_posix().encode() + b"\0")
                hashed.update(file.read_bytes() + b"\0")
    elif spec.has_location and spec.origin:
        hashed.update(Path(spec.origin).read_bytes())
    return hashed.hexdigest()[:_DIGITS]
