"""Declaration of the channels of a trace that a fitness function or measure reads."""

from collections.abc import Callable, Iterable
from typing import Any, TypeVar

from schema.errors import ExperimentError, nearest, shown
from schema.robot.trace import COMPUTED, CONSTANT, DERIVED, RECORDED

_Function = TypeVar("_Function", bound=Callable[..., float])
_ATTRIBUTE = "__revolve_needs__"


def needs(*channels: str) -> Callable[[_Function], _Function]:
    """Return a decorator that declares the channels of a trace that a function reads.

    Raises:
        ExperimentError: no such channel.
    """
    check_channels("needs", channels)

    def declare(function: _Function) -> _Function:
        setattr(function, _ATTRIBUTE, channels)
        return function

    return declare


def check_channels(where: str, names: Iterable[str]) -> None:
    """Raise ``ExperimentError``, with the nearest, unless all names are channels'."""
    known = (*RECORDED, *COMPUTED, *CONSTANT)
    for name in names:
        if name not in known:
            hint = f"{nearest(str(name), known)}; channels: {', '.join(known)}"
            raise ExperimentError(f"{where}: {shown(name)} is not a channel{hint}")


def channels_of(
    functions: Iterable[Callable[..., Any]], record: Iterable[str] = ()
) -> tuple[str, ...]:
    """Return the channels that exist only for some functions, in their fixed order.

    ``record`` names further ones.
    """
    wanted = {name for each in functions for name in getattr(each, _ATTRIBUTE, ())}
    wanted.update(record)
    for name in wanted & DERIVED.keys():
        wanted.update(DERIVED[name])
    return tuple(name for name in (*RECORDED, *COMPUTED) if name in wanted)
