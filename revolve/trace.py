"""Traces of robots, and their form between processes."""

import msgspec
import numpy as np

from schema.robot.robot import Robot
from schema.robot.trace import Trace

__all__ = ["PackedTrace", "Trace", "pack_trace", "unpack_trace"]

Constant = float | tuple[float, float, float] | None


class Array(msgspec.Struct, frozen=True):
    """Array of numbers as bytes, in row-major order."""

    shape: tuple[int, ...]
    kind: str
    data: bytes


class PackedTrace(msgspec.Struct, frozen=True):
    """Trace as a message, without its robot."""

    interval_s: float
    core_position: Array
    arrays: dict[str, Array]
    constants: dict[str, Constant]


def pack_trace(trace: Trace) -> PackedTrace:
    """Return a trace as a message."""
    arrays, constants = {}, {}
    for name, each in trace.channels.items():
        if isinstance(each, np.ndarray):
            arrays[name] = _pack(each)
        elif name != "robot":
            constants[name] = each
    return PackedTrace(trace.interval_s, _pack(trace.core_position), arrays, constants)


def unpack_trace(packed: PackedTrace, robot: Robot) -> Trace:
    """Return the trace of a message about a robot."""
    arrays = {name: _unpack(each) for name, each in packed.arrays.items()}
    channels: dict[str, object] = {**arrays, **packed.constants, "robot": robot}
    return Trace(packed.interval_s, _unpack(packed.core_position), channels)


def _pack(array: np.ndarray) -> Array:
    return Array(array.shape, array.dtype.str, array.tobytes())


def _unpack(array: Array) -> np.ndarray:
    return np.frombuffer(array.data, array.kind).reshape(array.shape).copy()
