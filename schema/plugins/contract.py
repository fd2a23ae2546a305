"""What all plug-ins must keep, checked by calls with sample inputs.

The check of each kind makes the inputs, calls the code by ``repeated``, and says what
the answer must be. It raises errors without key, file and line: ``naming_plugin`` adds
them.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from typing import TypeVar

import numpy as np
from msgspec import Struct, structs

from schema.errors import ExperimentError, shown

T = TypeVar("T")


def broken(
    what: str, must: str, value: object = None, *, came: str = ""
) -> ExperimentError:
    """Return the error of a plug-in that breaks a rule.

    ``what`` is the part of the plug-in, empty for all of it; ``came`` says what came if
    that is not a value.
    """
    got = came or shown(value)
    return ExperimentError(f"{what}{': ' if what else ''}must {must}, got {got}")


def repeated(what: str, call: Callable[[], T], arguments: Sequence[object] = ()) -> T:
    """Return what a plug-in returns for sample inputs; call it twice.

    ``what`` is as of ``broken``. The call has equal inputs, and equal random streams,
    each time; it must not change the arguments.

    Raises:
        ExperimentError: it returns another value the second time, or changes an input.
        Exception: any error of its code.
    """
    before = content_of(arguments)
    first = call()
    if before != content_of(arguments):
        raise broken(what, "not write to its arguments", "changed ones")
    content = content_of(first)
    second = call()
    if content != content_of(first) or content != content_of(second):
        came = f"{shown(first)} and {shown(second)}"
        raise broken(what, "return the same twice", came=came)
    return first


def content_of(value: object) -> object:
    """Return the content of a value, to be compared with ``==``; arrays by bytes."""
    if isinstance(value, np.ndarray):
        return value.dtype.str, value.shape, value.tobytes()
    if isinstance(value, Mapping):
        return {key: content_of(inner) for key, inner in value.items()}
    if isinstance(value, list | tuple):
        return type(value), [content_of(item) for item in value]
    if isinstance(value, Struct):
        return type(value), content_of(structs.astuple(value))
    if isinstance(value, float) and math.isnan(value):
        return "nan"
    return value
