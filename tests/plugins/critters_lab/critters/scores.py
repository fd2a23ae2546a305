"""A fitness function with parameters, and a measure."""

import math

import msgspec
import numpy as np

import revolve as rv


class Thrift(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """The table ``[fitness.parameters]``: speed that 1 W of the motors costs."""

    price: float = 0.01


@rv.needs("energy")
def thrifty(trace: rv.Trace, parameters: Thrift) -> float:
    """Return speed over ground [m/s] minus the price of the mean power."""
    seconds = (len(trace.core_position) - 1) * trace.interval_s
    x, y = trace.core_position[-1, :2] - trace.core_position[0, :2]
    power = float(trace.energy[-1]) / seconds
    return math.hypot(x, y) / seconds - parameters.price * power


def sway(trace: rv.Trace) -> float:
    """Return how far the core moves up and down [m]."""
    height = trace.core_position[:, 2]
    return float(np.max(height) - np.min(height))
