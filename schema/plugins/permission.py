"""Modules that this process may import as plug-ins.

A reference ``module:attribute`` may come from the network or from another person's
file, and an import runs the module. A process therefore imports built-in modules,
modules of installed entry points of the group ``revolve.plugins``, and modules that
its owner named: with ``--plugins``, or in an own experiment. A module allows the
modules inside it, too.

The list belongs to the process, as ``sys.modules`` does. The commands set it, and pass
it to the processes that they start, with the copies of sources that a run uses.
"""

import atexit
import sys
from collections.abc import Iterable
from filecmp import cmp
from functools import cache, lru_cache
from importlib import import_module
from importlib.machinery import FileFinder, SourceFileLoader
from importlib.metadata import entry_points
from importlib.util import find_spec, module_from_spec, spec_from_file_location
from pathlib import Path
from shutil import rmtree
from tempfile import mkdtemp
from types import ModuleType
from typing import Never

from schema.errors import ExperimentError, UnknownPlugin, near_files, shown
from schema.robot.archive import PACKED, SOURCES, read_archive

BUILT_IN = ("schema.parts", "schema.robogen_parts", "worker.fitness", "worker.tasks")
ROOMS = ("schema", "coordinator", "worker", "analyzer", "analysis", "revolve")
GROUP = "revolve.plugins"
FLAG = "--plugins"

_allowed: dict[str, Path | None] = {}
"""Allowed modules, with the file of those that are loaded from a file."""
_copies: dict[str, Path] = {}
"""Copies of top-level modules, files or folders, that replace whatever is installed."""


def allow(entries: Iterable[str]) -> None:
    """Allow modules; nothing is imported yet.

    Args:
        entries: one or some: names of modules, or paths of Python files; or
            ``NAME=PATH``: a module, and the file or folder that replaces whatever has
            the name of its top-level module; or packed robots, whose plug-ins do so.

    Raises:
        ExperimentError: no such module or file; a module of the standard library or of
            Revolve; a file with the name of another module.
        InvalidRobot: a file that is no packed robot.
    """
    for entry in [entries] if isinstance(entries, str) else entries:
        name, is_copy, place = entry.partition("=")
        if is_copy and _may_be_plugin(name):
            copy = Path(place).resolve()
            other = _copies.get(_top(name), copy)
            why = "" if other == copy else f"{other} is in use"
            if not (copy.is_dir() or (copy.suffix == ".py" and copy.is_file())):
                why = "no such .py file or folder"
            if why:
                raise UnknownPlugin(f"{FLAG}: {entry}: {why}")
            use_copy(_top(name), copy)
            _allowed.setdefault(name, None)
        elif entry.endswith(PACKED):
            contents, members = read_archive(Path(entry))
            files = (each for each in members.items() if each[0].startswith(SOURCES))
            allow(_copied(tuple(files), tuple(contents.plugins)))
        elif entry.endswith(".py"):
            _allow_file(Path(entry).resolve(), FLAG)
        else:
            _check_name(entry)
            if _source(_top(entry)) is None and _top(entry) not in _allowed:
                give = "give an installed module or the path of a .py file"
                raise UnknownPlugin(
                    f"{FLAG}: no module {shown(entry)} is installed; {give}"
                )
            _allowed.setdefault(entry, None)


@cache  # The same files have one folder: they are not in use as another source.
def _copied(files: tuple[tuple[str, bytes], ...], tops: tuple[str, ...]) -> list[str]:
    """Write modules to a folder that lasts as this process; return their entries."""
    try:
        folder = Path(mkdtemp(prefix="revolve-")).resolve()
        atexit.register(rmtree, folder, ignore_errors=True)
        for path, data in files:
            (folder / path).parent.mkdir(parents=True, exist_ok=True)
            (folder / path).write_bytes(data)
    except OSError as error:
        raise ExperimentError(f"{FLAG}: cannot unpack plug-ins: {error}") from None
    places = [(n, folder / SOURCES / p) for n in tops for p in (n, f"{n}.py")]
    return [f"{name}={place}" for name, place in places if place.exists()]


def allow_references(paths: Iterable[str], folder: Path | None = None) -> None:
    """Allow the modules that a document of this user refers to.

    Paths are ``module:attribute``; other texts are ignored. A module that is not
    installed may be a file in the folder of the document.

    Raises:
        ExperimentError: a file in the folder has the name of another module.
    """
    for path in paths:
        module, colon, _ = path.partition(":")
        if not colon or not _may_be_plugin(module):
            continue
        file = (folder / f"{module}.py").resolve() if folder else None
        if file is not None and "." not in module and file.is_file():
            _allow_file(file, "a plug-in of the experiment")
        elif not is_allowed(module):
            _allowed[module] = None


def use_copy(top: str, copy: Path) -> None:
    """Import a top-level module from a copy, unless another copy is in use.

    A module of one file is also allowed.
    """
    _copies.setdefault(top, copy.resolve())
    if not copy.is_dir():
        _allowed.setdefault(top, None)


def is_chosen(top: str) -> bool:
    """Return whether a top-level module is imported, or its source was named."""
    return top in sys.modules or top in _copies or _allowed.get(top) is not None


def allowed(*, is_new: bool = False) -> tuple[str, ...]:
    """Return the entries with which ``allow`` gives another process the same list.

    If a run is started, sources that are found come before the copies of an earlier run
    that was read.
    """
    found = []
    for name, file in _allowed.items():
        top = _top(name)
        copy = None if is_new and (file or _source(top)) else _copies.get(top)
        # A document may name a module that is not there.
        if source_of(top):
            found.append(f"{name}={copy}" if copy else str(file or name))
    return tuple(found)


def is_allowed(module: str) -> bool:
    """Return whether this process may import a module."""
    if module in BUILT_IN:
        return True
    if not _may_be_plugin(module):
        return False
    return any(
        module == name or module.startswith(f"{name}.")
        for name in (*_allowed, *_installed_modules())
    )


def allows_any_of(top: str) -> bool:
    """Return whether a top-level module, or a module inside it, is allowed."""
    return top in map(_top, (*_allowed, *_installed_modules()))


def is_own(path: str) -> bool:
    """Return whether a ``module:attribute`` names code outside of this project."""
    module, colon, _ = path.partition(":")
    return bool(colon) and _top(module) not in ROOMS


def how_to_allow(module: str) -> str:
    """Return which modules are allowed, and how to allow another one."""
    if not _may_be_plugin(module):
        return f"plug-ins are {', '.join(BUILT_IN)} and modules of users"
    names = ", ".join(dict.fromkeys([*_allowed, *_installed_modules()])) or "none"
    found = [] if "." in module else _source(module)
    entry = module if found is not None else f"PATH/{module}.py"
    if found == [Path.cwd() / f"{module}.py"]:
        entry = f"{module}.py"
    return f"allowed with {FLAG} are {names}; if you trust it, add {FLAG} {entry}"


def import_allowed(module: str) -> ModuleType:
    """Return a module that is allowed, imported if it is not yet.

    Raises:
        ValueError: the module is not allowed.
        Exception: any error of the module itself.
    """
    if not is_allowed(module):
        raise ValueError(f"module {module} is not allowed")
    top = _top(module)
    source = _copies.get(top) or _allowed.get(top)
    if source is not None and top not in sys.modules:
        _load(top, source)
    return import_module(module)


def _load(top: str, source: Path) -> None:
    """Import a top-level module from a file, or from the folder of a package."""
    if source.is_dir():
        loader = (_Uncached, [".py"])
        for folder in (source, *filter(Path.is_dir, source.rglob("*"))):
            # For the modules inside; also those that a function imports later.
            sys.path_importer_cache[str(folder)] = FileFinder(str(folder), loader)
        spec = FileFinder(str(source.parent), loader).find_spec(top)
    else:
        spec = spec_from_file_location(top, source, loader=_Uncached(top, str(source)))
    assert spec is not None
    made = module_from_spec(spec)
    # Registered first, as dataclasses and pickle expect.
    sys.modules[top] = made
    try:
        if spec.loader is not None:  # a folder without __init__.py has none
            spec.loader.exec_module(made)
    except BaseException:
        del sys.modules[top]
        raise


class _Uncached(SourceFileLoader):
    """Loader that neither reads nor writes compiled files.

    They may be older than their source, or not be made from it.
    """

    def path_stats(self, path: str) -> Never:
        raise OSError(path)


def source_of(top: str) -> list[Path]:
    """Return the file of a top-level module, or the folders of a package.

    Nothing is imported. The list is empty if there is no such module.
    """
    named = _copies.get(top) or _allowed.get(top)
    found = [named] if named else _source(top) or []
    return [each for each in found if each.exists()]


def _source(top: str) -> list[Path] | None:
    """Return where a top-level module is installed; None if it is not."""
    try:
        # Of a dotted name it would import the parents.
        spec = find_spec(top) if top.isidentifier() else None
    except (ImportError, ValueError):
        return None
    if spec is None:
        return None
    if spec.submodule_search_locations:
        return [Path(folder) for folder in spec.submodule_search_locations]
    return [Path(spec.origin)] if spec.has_location and spec.origin else []


def _allow_file(file: Path, where: str) -> None:
    """Allow a file as a module of its own name, unless that is another module's."""
    if not file.is_file():
        raise UnknownPlugin(f"{where}: no such file: {file}{near_files(file)}")
    top = file.stem
    _check_name(top)
    named, found = _copies.get(top) or _allowed.get(top), _source(top)
    others = [named] if named else [each.resolve() for each in found or ()]
    # A copy, as a run folder keeps it, is no other module.
    is_same = any(one.is_file() and cmp(file, one, shallow=False) for one in others)
    # A file in the folder of the script, or in the current one, is only found there.
    first = {Path(folder).resolve() for folder in ("", *sys.path[:1])}
    is_found = top not in _allowed and top not in sys.modules
    if is_found and any(one.parent in first for one in others):
        found = None
    if not is_same and (named or found is not None):
        other = others[0] if others else "a built-in module"
        why = f"has the name of another module, {other}: rename the file"
        raise ExperimentError(f"{where}: {file} {why}")
    _allowed[top] = file


def _check_name(module: str) -> None:
    """Raise unless a name may be that of a plug-in."""
    if not _may_be_plugin(module):
        rule = "a module outside the standard library and Revolve, or a .py file"
        raise ExperimentError(f"{FLAG}: must be {rule}, got {shown(module)}")


def _may_be_plugin(module: str) -> bool:
    is_name = all(word.isidentifier() for word in module.split("."))
    reserved = (*ROOMS, *sys.stdlib_module_names)
    return is_name and _top(module) not in reserved


@lru_cache(maxsize=1)
def _installed_modules() -> tuple[str, ...]:
    """Return the modules that installed distributions offer as plug-ins."""
    return tuple(sorted({entry.module for entry in entry_points(group=GROUP)}))


def _top(module: str) -> str:
    return module.partition(".")[0]
