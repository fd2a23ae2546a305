"""Traces of robots, and their form between processes."""

from typing import Any

import msgspec
import numpy as np

from schema.robot.results import Track as Trace

__all__ = ["PackedTrace", "Trace", "pack_trace", "unpack_trace"]


class Array(msgspec.Struct, frozen=True):
    """Array of numbers as bytes, in row-major order."""

    shape: tuple[int, ...]
    kind: str
    data: bytes


class PackedTrace(msgspec.Struct, frozen=True):
    """Trace as a message."""

    interval_s: float
    arrays: dict[str, Array]


def pack_trace(trace: Trace) -> PackedTrace:
    """Return a trace as a message."""
    found: dict[str, Any] = {"core_position": trace.core_position}
    arrays = {
        name: Array(each.shape, each.dtype.str, each.tobytes())
        for name, each in found.items()
    }
    return PackedTrace(trace.interval_s, arrays)


def unpack_trace(packed: PackedTrace) -> Trace:
    """Return the trace of a message."""
    arrays = {
        name: np.frombuffer(each.data, each.kind).reshape(each.shape).copy()
        for name, each in packed.arrays.items()
    }
    return Trace(packed.interval_s, **arrays)
