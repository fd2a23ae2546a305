"""Check of fitness functions and measures on simple hand-made traces."""

import math
from collections.abc import Callable
from numbers import Real
from typing import Any

import numpy as np

from schema.errors import ExperimentError, shown
from schema.plugins.needs import channels_of
from schema.plugins.origin import raised_text, where_defined
from schema.robot.robot import Part, Robot
from schema.robot.trace import CONSTANT, Floats, Trace

_SAMPLES = 61
_INTERVAL_S = 0.2
_PARTS = (
    Part("Core", -1, -1, -1, 0, (), 0),
    Part("ActiveHinge", 0, 0, 0, 0, (), 1),
    Part("FixedBrick", 1, 1, 0, 0, (), 2),
)


def check_function(
    function: Callable[..., Any], arguments: tuple[Any, ...], where: str
) -> None:
    """Raise unless a function of a trace keeps its contract on simple traces.

    A function may raise for some of the traces, which makes a failed evaluation, but
    not for all of them.

    Args:
        function: a fitness function or measure.
        arguments: after the trace.
        where: the key that names it, for messages.

    Raises:
        ExperimentError: it returns no number, a number that is not finite, different
            numbers for one trace, writes to the trace, or raises for each trace; with
            the file and line.
    """
    place = where_defined(function)
    raised: list[Exception] = []
    traces = simple_traces(function)
    for name, trace in traces.items():
        before = {key: each.copy() for key, each in _arrays(trace).items()}
        try:
            values = [function(trace, *arguments) for _ in range(2)]
        except Exception as error:  # noqa: BLE001 - of any function
            raised.append(error)
            continue
        if problem := _problem(values):
            raise ExperimentError(f"{where}: {place}: {problem} for a {name} trace")
        for key, each in _arrays(trace).items():
            if not np.array_equal(each, before[key]):
                raise ExperimentError(
                    f"{where}: {place}: must not write to the trace, but changed "
                    f"{key} of a {name} one"
                )
    if len(raised) == len(traces):
        first = raised[0]
        story = raised_text(first, place)
        raise ExperimentError(
            f"{where}: {place}: must return a number, raised {story}"
        ) from first


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
    found = {}
    for name, positions in tracks.items():
        turned = turn if name == "circular" else zero
        every = _channels(len(positions), turned[: len(positions)])
        chosen = {channel: every[channel] for channel in wanted}
        found[name] = Trace(_INTERVAL_S, positions, chosen)
    return found


def _channels(count: int, heading: Floats) -> dict[str, Any]:
    """Return all channels of a trace with some samples."""
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
        "part_position": np.array([(0.0, 0.0, 0.0), (0.05, 0.0, 0.0), (0.1, 0.0, 0.0)]),
        "light": (1.0, 0.0, 0.5),
        "robot": Robot(_PARTS),
        "mass": 0.3,
        "gravity": 9.81,
    }


def _problem(values: list[Any]) -> str:
    """Return what is wrong with the values of two calls; empty if nothing is."""
    for value in values:
        is_number = isinstance(value, Real) and not isinstance(value, bool)
        if not is_number:
            return f"must return a number, got {shown(value)}"
        if not math.isfinite(value):
            return f"must return a finite number, got {value}"
    if values[0] != values[1]:
        return f"must return the same twice, got {values[0]} and {values[1]}"
    return ""


def _arrays(trace: Trace) -> dict[str, Any]:
    found = {"core_position": trace.core_position, **trace.channels}
    return {key: each for key, each in found.items() if isinstance(each, np.ndarray)}
