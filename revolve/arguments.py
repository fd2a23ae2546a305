"""Checks of the arguments of the Python API."""

from collections.abc import Iterable
from operator import index
from typing import TypeVar

from schema.errors import RevolveError, shown

T = TypeVar("T")

MOST_NUMBER = 2**32 - 1
"""Greatest number of a birth, or of a robot of a seed."""


def whole_number(
    name: str, value: object, least: int = 0, most: int = MOST_NUMBER
) -> int:
    """Return an argument that is a whole number.

    Args:
        name: of the argument, for messages.
        value: of the argument; an integer of Python or NumPy.
        least: smallest number allowed.
        most: greatest number allowed.

    Raises:
        RevolveError: anything else.
    """
    try:
        number = index(value)  # type: ignore[arg-type]
    except TypeError:
        number = least - 1
    if least <= number <= most:
        return number
    raise RevolveError(
        f"{name}: must be a whole number from {least} to {most}, got {shown(value)}"
    )


def in_order(name: str, values: Iterable[T]) -> Iterable[T]:
    """Return an argument with values whose order is defined.

    Args:
        name: of the argument, for messages.
        values: of the argument.

    Raises:
        RevolveError: a set, or nothing with values.
    """
    given: object = values
    if isinstance(given, Iterable) and not isinstance(given, set | frozenset):
        return values
    raise RevolveError(
        f"{name}: must be a list, or another iterable with an order, got "
        f"{shown(values)}"
    )
