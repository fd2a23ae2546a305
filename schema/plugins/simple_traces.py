"""Check of fitness functions and measures on simple hand-made traces."""

import math
from collections.abc import Callable
from functools import partial
from numbers import Real
from typing import Any, cast

import numpy as np

from schema.errors import shown
from schema.plugins.contract import broken, repeated
from schema.robot.robot import Part, Robot
from schema.robot.trace import CONSTANT, Floats, Trace, channels_of

_SAMPLES = 61
_INTERVAL_S = 0.2
_PARTS = (
    Part("Core", -1, -1, -1, 0, (), 0),
    Part("ActiveHinge", 0, 0, 0, 0, (), 1),
    Part("FixedBrick", 1, 1, 0, 0, (), 2),
)


def check_function(function: Callable[..., Any], *arguments: object) -> None:
    """Raise unless a function of a trace keeps its contract on simple traces.

    A function may raise for some of the traces, which makes a failed evaluation, but
    not for all of them.

    Raises:
        Exception: what it raises for each trace, or ``ExperimentError`` for a broken
            rule.
    """
    raised: list[Exception] = []
    traces = simple_traces(function)

    def value_of(trace: Trace) -> object:
        try:
            return function(trace, *arguments)
        except Exception as error:  # noqa: BLE001 - of any function
            raised.append(error)
            return None

    for name, trace in traces.items():
        count = len(raised)
        call = partial(value_of, trace)
        value = repeated("", call, (trace.core_position, trace.channels))
        if len(raised) > count:
            continue
        is_number = isinstance(value, Real) and not isinstance(value, bool)
        came = f"{shown(value)} for a {name} trace"
        if not is_number:
            raise broken("", "return a number", came=came)
        if not math.isfinite(cast("float", value)):
            raise broken("", "return a finite number", came=came)
    if len(raised) >= 2 * len(traces):  # each is called twice
        raise raised[0]


def simple_traces(function: Callable[..., Any]) -> dict[str, Trace]:
    """Return traces by name, with the channels that a function declares.

    The robot stands still, walks along x, walks in a circle, or has two samples only.
    It has three parts, one joint and six sensor readings.
    """
    along, zero = np.linspace(0.0, 0.6, _SAMPLES), np.zeros(_SAMPLES)
    turn = np.linspace(0.0, 2.0 * np.pi, _SAMPLES)
    tracks = {
        "still": np.zeros((_SAMPLES, 3)),
        "straight": np.stack([along, zero, zero], axis=1),
        "circular": np.stack([np.cos(turn), np.sin(turn), zero], axis=1),
        "two-sample": np.array([(0.0, 0.0, 0.0), (0.01, 0.02, 0.03)]),
    }
    wanted = (*channels_of([function]), *CONSTANT)
    traces = {}
    for name, positions in tracks.items():
        turned = turn if name == "circular" else zero
        every = _channels(len(positions), turned[: len(positions)])
        chosen = {channel: every[channel] for channel in wanted}
        traces[name] = Trace(_INTERVAL_S, positions, chosen)
    return traces


def _channels(count: int, heading: Floats) -> dict[str, Any]:
    phase = np.arange(count) * _INTERVAL_S
    zero = np.zeros(count)
    wave = np.sin(phase)[:, np.newaxis]
    half = 0.5 * heading
    return {
        "core_attitude": np.stack([np.cos(half), zero, zero, np.sin(half)], axis=1),
        "joint_angle": wave,
        "joint_velocity": np.cos(phase)[:, np.newaxis],
        "joint_torque": 0.1 * wave,
        "energy": 0.05 * phase,
        "contact": np.tile([True, False, True], (count, 1)),
        "readings": np.tile([0.0, 0.0, 9.81, 0.0, 0.0, 0.0], (count, 1)),
        "neighbours": np.zeros(count, dtype=np.int64),
        "outputs": 0.5 + 0.5 * wave,
        "commands": wave,
        "part_poses": np.tile([0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0], (count, 3, 1)),
        "part_position": np.array([(0.0, 0.0, 0.0), (0.05, 0.0, 0.0), (0.1, 0.0, 0.0)]),
        "light": (1.0, 0.0, 0.5),
        "robot": Robot(_PARTS),
        "mass": 0.3,
        "gravity": 9.81,
    }
