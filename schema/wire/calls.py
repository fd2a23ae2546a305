"""Calls of a user's own functions by workers: their settings, and plain values.

Arguments and values are plain: None, truth values, numbers, texts, bytes, lists and
dicts of such. They travel as MessagePack; no object of another kind does, and no code.
As bytes of bytes: lists and dicts of any value take some seventy times their bytes.
"""

from types import UnionType
from typing import Any, cast

import msgspec

from schema.errors import ExperimentError, one_line
from schema.experiment.section import Section
from schema.limits import MOST_SHOWN, VALUE_BYTES, printable
from schema.wire.codec import decode, encode

_PLAIN = "None, bool, int, float, str, bytes (of robots: Genome.to_bytes), list or dict"
_LEAVES = (type(None), bool, int, float, str, bytes)


class CallSettings(Section, frozen=True):
    """Settings of a call: the function as ``module:attribute``."""

    function: str


def call_settings(function: str) -> bytes:
    """Return the settings of the calls of a function."""
    return msgspec.json.encode(CallSettings(function=function))


def pack_value(value: object) -> bytes:
    """Return the bytes of a plain value; tuples become lists.

    Raises:
        ExperimentError: a value of another kind, or one that is too large.
    """
    try:
        data = encode(value)
    except (TypeError, ValueError, OverflowError, RecursionError) as error:
        why = printable(one_line(error), 2 * MOST_SHOWN)
        raise ExperimentError(
            f"must be {_PLAIN}, got {type(value).__name__}: {why}"
        ) from None
    if strange := _strange_kinds(value):
        raise ExperimentError(f"must be {_PLAIN}, got {', '.join(strange)}")
    if len(data) > VALUE_BYTES:
        raise ExperimentError(f"must have <= {VALUE_BYTES} bytes, got {len(data)}")
    return data


def unpack_value(data: bytes) -> Any:  # noqa: ANN401 - any plain value
    """Return the plain value of some bytes.

    Raises:
        MalformedMessage: not the bytes of a value, or too many.
    """
    return decode(cast("UnionType", Any), data, VALUE_BYTES)


def _strange_kinds(value: object) -> list[str]:
    """Return the names of the kinds of a value, or in it, that are not plain.

    MessagePack writes some of them as others: a set as a list in no defined order.
    """
    strange: set[str] = set()
    waiting = [value]
    while waiting:
        inner = waiting.pop()
        if isinstance(inner, dict):
            waiting += [*inner, *inner.values()]
        elif not isinstance(inner, list | tuple):
            if not isinstance(inner, _LEAVES):
                strange.add(type(inner).__name__)
        # Of a long list of numbers, fast.
        elif not set(_LEAVES).issuperset(map(type, inner)):
            waiting += inner
    return sorted(strange)
