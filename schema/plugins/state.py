"""What a plug-in changes when it is called: users' modules, and its object."""

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


def own_modules() -> list[str]:
    """Return the names of users' modules that this process has loaded."""
    return [name for name in [*sys.modules] if is_own(f"{name}:") and is_allowed(name)]


@contextmanager
def unchanged(
    rule: str, modules: Collection[str], plugin: object = None
) -> Iterator[None]:
    """Raise ``ExperimentError`` if a block changes a name of modules or of an object.

    ``rule`` says what the plug-in must do.
    """
    owners = {"self": plugin, **{name: sys.modules[name] for name in modules}}

    def state() -> dict[str, object]:
        content = _Reader(modules).content
        return {
            f"{owner}.{name}": content(value)
            for owner, thing in owners.items()
            for name, value in _attributes(thing)
        }

    before = state()
    yield
    after = state()
    for name in [*before, *after]:
        if (name in before, before.get(name)) != (name in after, after.get(name)):
            raise ExperimentError(f"must {rule}, but changes {name}")


def _attributes(thing: object) -> Iterator[tuple[str, Any]]:
    """Yield the attributes of a module, class or object, in slots or not."""
    for name, value in getattr(thing, "__dict__", {}).items():
        if not name.startswith("__"):
            yield name, value
    for kind in type(thing).__mro__:
        slots = kind.__dict__.get("__slots__", ())
        for name in (slots,) if isinstance(slots, str) else slots:
            if name != "__dict__" and hasattr(thing, name):
                yield name, getattr(thing, name)


class _Reader:
    """Reads the content of values; objects of other packages are what they print."""

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
        inside = self._inside(value)
        return type(value), [(self.content(at), self.content(it)) for at, it in inside]

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
