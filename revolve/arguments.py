"""Checks of the arguments of the Python API."""

import re
import sys
from collections.abc import Iterable, Iterator
from contextlib import contextmanager
from operator import index
from typing import TypeVar

import numpy as np

from schema.errors import RevolveError, counted, shown
from schema.limits import MOST_NUMBER, MOST_PIXELS
from schema.robot.trace import Floats

T = TypeVar("T")
_TLS = re.compile(r"--tls-(\w+)")
_FLAG = re.compile(
    r"--(births|colours|connect|experiment|figures|fleet|format|out|plugins|seed|style|"
    r"width|workers)\b"
)
_RESUME = re.compile("to resume it: revolve resume [^;]*")
"""Advice about a folder that is used."""


def whole_number(
    name: str, value: object, least: int = 0, most: int = MOST_NUMBER
) -> int:
    """Return an argument that is a whole number; raise ``RevolveError`` for others."""
    try:
        number = index(value)  # type: ignore[arg-type]
    except TypeError:
        number = least - 1
    if least <= number <= most and not isinstance(value, bool):
        return number
    raise RevolveError(
        f"{name}: must be a whole number from {least} to {most}, got {shown(value)}"
    )


def is_silent(*, progress: bool | None) -> bool:
    """Return whether to show no progress; None: show it in notebooks only."""
    return not ("ipykernel" in sys.modules if progress is None else progress)


def picture_size(width: int, height: int) -> tuple[int, int]:
    """Return the size of a picture [pixels]; raises as ``whole_number``."""
    return (
        whole_number("width", width, 1, MOST_PIXELS),
        whole_number("height", height, 1, MOST_PIXELS),
    )


def finite_numbers(name: str, values: object, count: int, unit: str) -> Floats:
    """Return an argument of (count,) finite numbers; ``RevolveError`` for others."""
    try:
        array = np.asarray(values)
    except ValueError:  # lists of different lengths
        array = np.empty(0)
    is_number = array.shape == (count,) and array.dtype.kind in "fiu"
    if is_number and np.isfinite(array).all():
        return array.astype(np.float64)
    rule = f"must be {counted(count, 'finite number')}{unit}"
    raise RevolveError(f"{name}: {rule}, got {shown(values)}")


@contextmanager
def naming_arguments() -> Iterator[None]:
    """Let errors name arguments and environment variables instead of flags."""
    try:
        yield
    except RevolveError as error:
        line = _TLS.sub(lambda flag: f"$REVOLVE_TLS_{flag[1].upper()}", str(error))
        line = _RESUME.sub("revolve.read opens it, revolve.resume continues it", line)
        raise type(error)(_FLAG.sub(r"\1", line)) from None


def in_order(name: str, values: Iterable[T]) -> Iterable[T]:
    """Return an argument with values whose order is defined; else ``RevolveError``."""
    given: object = values
    if isinstance(given, Iterable) and not isinstance(given, set | frozenset):
        return values
    raise RevolveError(
        f"{name}: must be a list, or another iterable with an order, got "
        f"{shown(values)}"
    )
