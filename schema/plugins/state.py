"""State of users' modules and objects: what a plug-in changes when it is called."""

import sys
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from collections.abc import Set as AbstractSet
from contextlib import contextmanager
from types import FunctionType
from typing import Any

import numpy as np
from msgspec import Struct

from schema.errors import ExperimentError
from schema.plugins.contract import content_of
from schema.plugins.permission import is_allowed, is_own

State = dict[str, object]
"""Content of each name, comparable by ``==``."""


def own_modules() -> list[str]:
    """Return the names of users' modules that this process has loaded."""
    return [name for name in [*sys.modules] if is_own(f"{name}:") and is_allowed(name)]


def state_of_modules(names: Collection[str]) -> State:
    """Return the content of all global names of some modules."""
    reader = _Reader(names)
    return {
        f"{module}.{name}": reader.content(value)
        for module in names
        for name, value in vars(sys.modules[module]).items()
        if not name.startswith("__")
    }


def state_of_object(plugin: object, modules: Collection[str]) -> State:
    """Return the content of all attributes of an object of users' modules."""
    reader = _Reader(modules)
    return {name: reader.content(value) for name, value in _attributes(plugin)}


@contextmanager
def unchanged(
    rule: str, modules: Collection[str], plugin: object = None
) -> Iterator[None]:
    """Raise if a block changes users' modules, or an object.

    Args:
        rule: what the plug-in must do instead; begins the message.
        modules: names of users' modules.
        plugin: object that must not change, either.

    Raises:
        ExperimentError: it changes one of their names; or as of the block.
    """

    def state() -> State:
        own = state_of_object(plugin, modules) if plugin is not None else {}
        names = {f"self.{name}": content for name, content in own.items()}
        return {**state_of_modules(modules), **names}

    before = state()
    yield
    after = state()
    for name in dict.fromkeys([*before, *after]):
        if name not in before or name not in after or before[name] != after[name]:
            raise ExperimentError(f"must {rule}, but changes {name}")


def _attributes(plugin: object) -> Iterator[tuple[str, Any]]:
    """Yield the attributes of an object, in slots or not, or of a class."""
    for name, value in getattr(plugin, "__dict__", {}).items():
        if not name.startswith("__"):
            yield name, value
    for kind in type(plugin).__mro__:
        slots = kind.__dict__.get("__slots__", ())
        for name in (slots,) if isinstance(slots, str) else slots:
            if hasattr(plugin, name):
                yield name, getattr(plugin, name)


class _Reader:
    """Reads the content of values, of each object once.

    Objects of other packages count as what they print.
    """

    def __init__(self, modules: Collection[str]) -> None:
        self._modules = modules
        # The objects are kept, or others could get their ids.
        self._seen: dict[int, tuple[int, object]] = {}

    def content(self, value: Any) -> object:  # noqa: ANN401 - any value
        """Return the content of a value; of a known object, its number."""
        if isinstance(value, int | float | complex | str | bytes | None):
            return content_of(value)
        if id(value) in self._seen:
            return self._seen[id(value)][0]
        self._seen[id(value)] = len(self._seen), value
        if isinstance(value, np.ndarray) and value.dtype != object:
            return content_of(value)
        return type(value), [
            (self.content(name), self.content(inner))
            for name, inner in self._inside(value)
        ]

    def _inside(self, value: Any) -> Iterable[tuple[object, Any]]:  # noqa: ANN401
        """Return what a value consists of, with names."""
        if isinstance(value, Mapping):
            return value.items()
        if isinstance(value, Sequence | AbstractSet | np.ndarray):
            return enumerate(value.flat if isinstance(value, np.ndarray) else value)
        home = value if isinstance(value, type | FunctionType) else type(value)
        if home.__module__ not in self._modules and not isinstance(value, Struct):
            return [("", repr(value))]
        if isinstance(value, FunctionType):
            cells = [cell.cell_contents for cell in value.__closure__ or ()]
            defaults = value.__defaults__, value.__kwdefaults__
            return enumerate((*defaults, vars(value), cells))
        return _attributes(value)
