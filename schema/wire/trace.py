"""Traces of robots as messages, and back."""

from math import prod

import numpy as np

from schema.errors import MalformedMessage
from schema.robot.robot import Robot
from schema.robot.trace import Trace
from schema.wire.messages import Array, PackedTrace


def pack_trace(trace: Trace) -> PackedTrace:
    """Return a trace as a message."""
    arrays, constants = {}, {}
    for name, each in trace.channels.items():
        if isinstance(each, np.ndarray):
            arrays[name] = _pack(each)
        elif name != "robot":
            constants[name] = each
    return PackedTrace(trace.interval_s, _pack(trace.core_position), arrays, constants)


def check_trace(packed: PackedTrace) -> None:
    """Raise ``MalformedMessage`` unless the bytes of all arrays fit their shapes."""
    for array in (packed.core_position, *packed.arrays.values()):
        size = prod(array.shape) * np.dtype(array.kind).itemsize
        if len(array.data) != size:
            got = f"must have {size} bytes, got {len(array.data)}"
            raise MalformedMessage(f"trace: an array {got}", "impossible")


def unpack_trace(packed: PackedTrace, robot: Robot) -> Trace:
    """Return the trace of a message about a robot."""
    arrays = {name: _unpack(each) for name, each in packed.arrays.items()}
    channels: dict[str, object] = {**arrays, **packed.constants, "robot": robot}
    return Trace(packed.interval_s, _unpack(packed.core_position), channels)


def _pack(array: np.ndarray) -> Array:
    return Array(array.shape, array.dtype.str, array.tobytes())  # type: ignore[arg-type]


def _unpack(array: Array) -> np.ndarray:
    return np.frombuffer(array.data, array.kind).reshape(array.shape).copy()
