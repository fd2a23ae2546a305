"""Loading of plug-ins by name: ``"package.module:attribute"``.

There is no registry; the process that runs the code resolves the name. It imports only
modules that are allowed there, and takes from them only objects of the kind that the
caller declares.
"""

import inspect
from collections.abc import Callable, Collection, Mapping
from difflib import get_close_matches
from functools import lru_cache
from types import ModuleType
from typing import Any, TypeVar, cast

from schema.errors import (
    ExperimentError,
    UnknownPlugin,
    counted,
    error_text,
    nearest,
    shown,
)
from schema.plugins.origin import where_defined, where_named, where_raised
from schema.plugins.permission import (
    how_to_allow,
    import_allowed,
    is_allowed,
    source_of,
)
from schema.plugins.source import digest_in_use

T = TypeVar("T")


def load_object(
    path: str,
    where: str,
    built_in: Mapping[str, T],
    members: tuple[str, ...] = (),
    kind: type[T] | None = None,
) -> T:
    """Return the built-in or own object that a key of an experiment names.

    ``path`` is the short name of a built-in object, or ``module:attribute`` of an own
    one, which must have some members or be of a type; ``where`` is for messages.

    Raises:
        ExperimentError: no such object (the nearest is named), a module that is not
            allowed or whose import raises; an object of another type, or without an
            attribute.
    """
    if ":" not in path and built_in:
        if path not in built_in:
            raise unknown(path, where, built_in)
        return built_in[path]
    found = _load(path, where)
    missing = [f"has no {name!r}" for name in members if not hasattr(found, name)]
    problem = missing[0] if missing else ""
    if kind is not None and not isinstance(found, kind):
        problem = f"is not a {kind.__name__}, but a {type(found).__name__}"
    if problem:
        raise ExperimentError(f"{where}: {place_of(path)}: {path!r} {problem}")
    return cast("T", found)


def unknown(path: str, where: str, built_in: Collection[str]) -> UnknownPlugin:
    """Return the error of a short name that is none of the built-in ones."""
    rule = f"must be one of {', '.join(built_in)} or 'module:attribute'"
    got = f"got {shown(path)}{nearest(path, built_in)}"
    return UnknownPlugin(f"{where}: {rule}, {got}")


def load_function(
    path: str, where: str, arguments: int, names: str = ""
) -> Callable[..., Any]:
    """Return the function that a dotted path names.

    ``where`` and ``names``, of its arguments, are for messages.

    Raises:
        ExperimentError: as for ``load_object``; no function of so many arguments,
            or one that was defined in a module that is not allowed.
    """
    found = _load(path, where)
    if not callable(found) or isinstance(found, type):
        raise ExperimentError(f"{where}: {place_of(path)}: {path!r} is not a function")
    # A module that imports a function of another one does not offer it.
    home = str(getattr(found, "__module__", None))
    if not is_allowed(home):
        why = f"is defined in {home}, which is not allowed: {how_to_allow(home)}"
        raise UnknownPlugin(f"{where}: {path!r} {why}")
    try:
        inspect.signature(found).bind(*range(arguments))
    except (TypeError, ValueError) as error:
        wanted = f"{path!r} must take {counted(arguments, 'argument')}"
        given = f" ({names}), this one takes {_taken(found)}" if names else f": {error}"
        raise ExperimentError(f"{where}: {place_of(path)}: {wanted}{given}") from None
    return found


def _taken(function: Callable[..., Any]) -> str:
    """Return the arguments of a function as its definition has them."""
    try:
        names = inspect.signature(function).parameters
    except ValueError:
        return "others"
    return f"{len(names)} ({', '.join(names)})" if names else "none"


def _load(path: str, where: str) -> object:
    """Return the object that a dotted path names, of any type.

    The permission is checked at every call, before the cache.
    """
    module_name, colon, attribute = path.partition(":")
    words = [*module_name.split("."), attribute]
    if not (colon and all(word.isidentifier() for word in words)):
        raise UnknownPlugin(f"{where}: must be 'module:attribute', got {shown(path)}")
    if module_name.endswith(".py"):
        meant = f"{module_name.removesuffix('.py')}:{attribute}"
        got = f"got {shown(path)}; did you mean {meant!r}?"
        raise UnknownPlugin(f"{where}: must be 'module:attribute', {got}")
    if not is_allowed(module_name):
        why = f"module {shown(module_name)} is not allowed"
        how = how_to_allow(module_name)
        raise UnknownPlugin(f"{where}: {shown(path)}: {why}: {how}")
    return _loaded(module_name, attribute, where)


@lru_cache(maxsize=256)
def _loaded(module_name: str, attribute: str, where: str) -> object:
    module = load_module(module_name, where, f"{module_name}:{attribute}")
    if not hasattr(module, attribute):
        names = [
            name
            for name, value in vars(module).items()
            if not (name.startswith("_") or _is_imported(value, module_name))
        ]
        near = get_close_matches(attribute, names, n=1)
        hint = f"; did you mean '{module_name}:{near[0]}'?" if near else ""
        place = where_named(module, attribute)
        why = f"{module_name} has no {attribute!r}{hint}"
        raise UnknownPlugin(f"{where}: {place}: {why}")
    return getattr(module, attribute)


def _is_imported(value: object, module_name: str) -> bool:
    """Return whether a module, class or function is not of this module."""
    if inspect.isclass(value) or inspect.isroutine(value):
        return bool(value.__module__ != module_name)
    return isinstance(value, ModuleType)


def load_module(name: str, where: str, path: str = "") -> ModuleType:
    """Return a module that is allowed.

    ``where`` needs it, or a ``path`` of it; both are for messages.

    Raises:
        ExperimentError: it is not there, or its import raises another error.
    """
    wanted = path or name
    try:
        module = import_allowed(name)
    # A module may call exit().
    except (Exception, SystemExit) as error:
        names = [source.name for source in source_of(name.partition(".")[0])]
        line = next(filter(None, (where_raised(error, each) for each in names)), "")
        start = f"{where}: {line}{': ' if line else ''}{wanted!r}"
        if not isinstance(error, ImportError):
            raise ExperimentError(f"{start}: {error_text(error)}") from error
        missing = isinstance(error, ModuleNotFoundError) and error.name == name
        hint = f": no {name}.py is beside the experiment" if missing else ""
        raise UnknownPlugin(f"{start}: {error}{hint}") from None
    digest_in_use(name)  # remembers it
    return module


def place_of(path: str, plugin: object = None) -> str:
    """Return file and line of a loaded ``module:attribute`` or a built-in plug-in."""
    module_name, colon, attribute = path.partition(":")
    if not colon:
        return where_defined(plugin)
    return where_named(import_allowed(module_name), attribute)
