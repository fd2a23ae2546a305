"""Measured sensors and motors of one robot: gain, offset, noise and delay."""

from collections import deque
from collections.abc import Sequence

import numpy as np

from schema.experiment.robust import IDEAL, Calibration, Response
from schema.parts import BodySpace
from schema.robot.brain import Widths
from schema.robot.robot import Robot
from schema.robot.trace import Floats

NEUTRAL = 0.5
"""Output at which a joint is in the middle of its range, or at rest."""


class Calibrated:
    """Responses of the sensors and motors of one robot, with the values on their way.

    Attributes:
        noise: standard deviations of the I inputs and the O outputs of every network,
            (I,) and (O,), 0 beyond the robot's own; None if all are 0.
    """

    def __init__(
        self,
        robot: Robot,
        space: BodySpace,
        entries: Sequence[Calibration],
        *,
        tick_s: float,
        width: Widths,
    ) -> None:
        known = {entry.part: entry for entry in entries}
        own = [
            (space[part.kind], known.get(part.kind) or Calibration(part=part.kind))
            for part in robot.parts
        ]
        sensors = [entry.sensor for kind, entry in own for _ in range(kind.inputs)]
        motors = [entry.motor for kind, entry in own for _ in range(kind.outputs)]
        motors += [IDEAL] * (width.outputs - len(motors))
        self._sensors = _Channels(sensors, tick_s)
        self._motors = _Channels(motors, tick_s)
        sensors += [IDEAL] * (width.inputs - len(sensors))
        noise = _of(sensors, "noise"), _of(motors, "noise")
        self.noise = noise if any(map(np.any, noise)) else None

    def readings(self, _tick: int, values: Floats) -> Floats:
        """Return what the brain receives at a tick, without noise, (1, N).

        ``values`` are (1, N) true readings; before the first tick they were the same.
        """
        return self._sensors.pass_on(values[0], values[0])[np.newaxis]

    def outputs(self, _tick: int, values: Floats) -> Floats:
        """Return the outputs that reach the motors at a tick, without noise, (1, O).

        ``values`` are (1, O) of the network, clipped here to [0, 1]; before the first
        tick they were neutral.
        """
        moved = np.clip(values[0], 0.0, 1.0) - NEUTRAL
        late = self._motors.pass_on(moved, np.zeros(len(moved))) + NEUTRAL
        return late[np.newaxis]


class _Channels:
    """Gain, offset and delay of C channels."""

    def __init__(self, responses: Sequence[Response], tick_s: float) -> None:
        self._gains = _of(responses, "gain")
        self._offsets = _of(responses, "offset")
        delays = [round(each.delay_s / tick_s) for each in responses]
        self._delays = np.array(delays, np.intp)
        self._past: deque[Floats] = deque(maxlen=1 + max(delays, default=0))

    def pass_on(self, values: Floats, before: Floats) -> Floats:
        """Return the values that leave the channels, (C,), for those that enter.

        ``before`` entered at all times before the first.
        """
        if not self._past:
            self._past.extend([before.copy()] * (self._past.maxlen or 1))
        self._past.appendleft(values.copy())
        late: Floats = np.array(self._past)[self._delays, np.arange(len(values))]
        return self._gains * late + self._offsets


def _of(responses: Sequence[Response], key: str) -> Floats:
    return np.array([getattr(each, key) for each in responses], np.float64)
