"""Declaration of the channels of a trace that a fitness function or measure reads."""

from collections.abc import Callable, Iterable
from typing import Any, TypeVar

from schema.errors import ExperimentError, nearest, shown
from schema.robot.trace import COMPUTED, CONSTANT, RECORDED

_Function = TypeVar("_Function", bound=Callable[..., float])
_ATTRIBUTE = "__revolve_needs__"


def needs(*channels: str) -> Callable[[_Function], _Function]:
    """Return a decorator that declares the channels of a trace that a function reads.

    Raises:
        ExperimentError: no such channel.
    """
    known = (*RECORDED, *COMPUTED, *CONSTANT)
    for name in channels:
        if name not in known:
            hint = f"{nearest(name, known)}; channels: {', '.join(known)}"
            raise ExperimentError(f"needs: {shown(name)} is not a channel{hint}")

    def declare(function: _Function) -> _Function:
        setattr(function, _ATTRIBUTE, channels)
        return function

    return declare


def channels_of(functions: Iterable[Callable[..., Any]]) -> tuple[str, ...]:
    """Return the channels that exist only for some functions, in their fixed order."""
    wanted = {name for each in functions for name in getattr(each, _ATTRIBUTE, ())}
    return tuple(name for name in (*RECORDED, *COMPUTED) if name in wanted)
