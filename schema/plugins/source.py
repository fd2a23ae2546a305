"""Digests of plug-ins, to check that two machines have the same code.

The digest covers the source files of a plug-in's top-level module or package. The
packages of this project are not plug-ins; their version identifies them.
"""

import json
import re
import sys
from collections.abc import Iterable, Iterator
from functools import lru_cache
from hashlib import sha256
from pathlib import Path

from schema.errors import PluginDiffers, check_most, shown
from schema.limits import MOST_PLUGIN_CHARACTERS
from schema.plugins.permission import (
    FLAG,
    ROOMS,
    allows_any_of,
    how_to_allow,
    source_of,
)

PATH = re.compile(r"([A-Za-z_]\w*)(?:\.[A-Za-z_]\w*)*:[A-Za-z_]\w*")
_PARAMETERS = re.compile(r"(?:.*[._])?parameters(?:\..*)?", re.DOTALL)
"""Keys of parameters of plug-ins, those of a sweep included."""
_DIGITS = 12
_IMPORTED = "__revolve_digest__"


@lru_cache(maxsize=64)
def plugins_of(settings: bytes) -> str:
    """Return the plug-ins that JSON names as ``module=digest``, with spaces between."""
    return " ".join(f"{name}={_digest(name)}" for name in modules_named(settings))


def modules_named(document: bytes) -> list[str]:
    """Return the top-level modules of the plug-ins that JSON names, sorted.

    Every text like ``module:attribute`` names a plug-in, but for the document's own
    name and for parameters of plug-ins, which may be any text.

    Raises:
        ValueError: the document is not JSON.
    """
    modules = (path.partition(":")[0] for path in paths_named(json.loads(document)))
    return sorted({name.partition(".")[0] for name in modules}.difference(ROOMS))


def paths_named(document: object) -> list[str]:
    """Return each ``module:attribute`` that the content of a document names, once."""
    return list(dict.fromkeys(filter(PATH.fullmatch, _texts(document))))


def _texts(document: object) -> Iterator[str]:
    """Yield the texts and keys of JSON, without its name and plug-ins' parameters."""
    if isinstance(document, dict):
        document = {key: document[key] for key in document if key != "name"}
    left = [document]
    while left:
        value = left.pop()
        if isinstance(value, str):
            yield value
        elif isinstance(value, list | tuple):
            left += value
        elif isinstance(value, dict):
            for key, inner in value.items():
                if not _PARAMETERS.fullmatch(key):
                    left += key, inner


@lru_cache(maxsize=64)
def check_plugins(wanted: str, run: str = "") -> None:
    """Raise unless this machine has the plug-ins of ``plugins_of``, all allowed.

    Nothing is imported. The name of the run that wants them ends with its folder.

    Raises:
        PluginDiffers: one is missing, not allowed or of another source; a long text.
    """
    most, what = MOST_PLUGIN_CHARACTERS, "characters"
    check_most(len(wanted), most, what, "list of plug-ins", PluginDiffers)
    for each in wanted.split():
        name, _, digest = each.partition("=")
        if not allows_any_of(name):
            why = "among those that it may import"
            how = how_to_allow(name)
            raise PluginDiffers(f"has no plug-in {shown(name)} {why}: {how}")
        found = _digest(name)
        if not found:
            raise PluginDiffers(f"has no plug-in {shown(name)}: it is not installed")
        if found != digest:
            differs = f"its plug-in {shown(name)} differs from the coordinator's"
            why = f"source digest {found}, expected {digest[:_DIGITS]}"
            raise PluginDiffers(f"{differs}: {why}: {_how_to_give(name, run)}")


def _how_to_give(name: str, run: str) -> str:
    """Return how a worker that was started separately gets the source of a run."""
    source, folder = source_of(name)[0], run.split(":", 2)[-1]
    way = f"give {source} the content that it had when the run began"
    if not folder.startswith("/"):
        return way  # jobs from Python have no run folder
    copy = f"{name}={folder}/plugins/{name}{'' if source.is_dir() else '.py'}"
    return f"{way}, or start this process with the run's copy: {FLAG} {copy}"


def digest_of(module: str) -> str:
    """Return the digest of a plug-in module's source now; empty if it is not there."""
    return _digest.__wrapped__(module.partition(".")[0])


def digest_in_use(module: str) -> str:
    """Return the digest of a plug-in module as it was first imported, or is now."""
    top = module.partition(".")[0]
    known = vars(sys.modules[top]) if top in sys.modules else {}
    if _IMPORTED not in known and top not in ROOMS:
        known[_IMPORTED] = digest_of(top)
    return str(known.get(_IMPORTED, ""))


def digest_of_sources(sources: Iterable[Path]) -> str:
    """Return the digest of a module's file, or of the folders of a package."""
    hashed = sha256()
    for source in sources:
        if source.is_dir():
            for file in sorted(source.rglob("*.py")):
                hashed.update(file.relative_to(source).as_posix().encode() + b"\0")
                hashed.update(file.read_bytes() + b"\0")
        else:
            hashed.update(source.read_bytes())
    return hashed.hexdigest()[:_DIGITS]


def forget_digests() -> None:
    """Read the sources again next time: their owner may have changed them."""
    for cached in (plugins_of, check_plugins, _digest):
        cached.cache_clear()


@lru_cache(maxsize=64)
def _digest(module: str) -> str:
    """Return the digest of a top-level module's source; empty if not installed."""
    sources = source_of(module)
    return digest_of_sources(sources) if sources else ""
