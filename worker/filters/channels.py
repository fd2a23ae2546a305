"""Inputs and outputs of one robot: measured, held or dead, and a list of them."""

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from schema.errors import InvalidRobot
from schema.experiment.robust import IDEAL, Calibration, Response
from schema.experiment.settings import Ablation, ablation_problems
from schema.parts import BodySpace, Sensor
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


class Ablated:
    """Held inputs and dead motors of one robot in an evaluation."""

    def __init__(
        self, ablation: Ablation, robot: Robot, means: Sequence[float] = ()
    ) -> None:
        """Look up the inputs and motors.

        Raises:
            InvalidRobot: it has no such input or motor.
        """
        brain = robot.brain
        sizes = brain.count("input"), brain.count("output")
        for problem in ablation_problems(ablation, *sizes):
            raise InvalidRobot(problem)
        self._inputs = np.array([number for number, _ in ablation.inputs], np.intp)
        self._values = np.array(
            [
                means[number] if value is None else value
                for number, value in ablation.inputs
            ],
            np.float64,
        )
        self._motors = np.array(ablation.motors, np.intp)

    def readings(self, _tick: int, values: Floats) -> Floats:
        """Return readings (1, I) with the held values."""
        received = values.copy()
        received[0, self._inputs] = self._values
        return received

    def outputs(self, _tick: int, values: Floats) -> Floats:
        """Return outputs (1, O) in which those to dead motors are neutral."""
        reached = values.copy()
        reached[0, self._motors] = NEUTRAL
        return reached


_AXES = ("acceleration", "rotation")


@dataclass(frozen=True, slots=True)
class AblationCase:
    """Ablation of one robot, and what it concerns.

    Attributes:
        group: ``HELD``, ``MEAN`` or ``DEAD``.
        scope: ``one`` input or motor, all of a ``kind``, or ``all``.
        kind: of the sensors (imu, touch, light, or name of a plug-in's class), or part
            type of the motors; empty for ``all``.
        part: index of the part; None unless the scope is ``one``.
        channel: number of the input or motor of the brain; None likewise.
        name: for people, such as ``touch left of part 5``.
    """

    group: str
    scope: str
    kind: str
    part: int | None
    channel: int | None
    name: str
    ablation: Ablation


HELD, MEAN, DEAD = "input at 0", "input at its mean", "motor dead"


def all_ablations(robot: Robot, space: BodySpace) -> tuple[AblationCase, ...]:
    """Return the ablations of a robot: one by one, by kind, and all together."""
    inputs, motors = inputs_of(robot, space), motors_of(robot, space)

    def held(value: float | None) -> Callable[[Sequence[int]], Ablation]:
        return lambda numbers: Ablation(inputs=tuple((n, value) for n in numbers))

    def dead(numbers: Sequence[int]) -> Ablation:
        return Ablation(motors=tuple(numbers))

    return (
        *_changes(HELD, "sensors", inputs, held(0.0)),
        *_changes(MEAN, "sensors", inputs, held(None)),
        *_changes(DEAD, "motors", motors, dead),
    )


Channel = tuple[str, int, str]
"""Kind, index of the part and name of an input or motor."""


def _changes(
    group: str,
    what: str,
    channels: Sequence[Channel],
    ablation: Callable[[Sequence[int]], Ablation],
) -> Iterator[AblationCase]:
    for number, (kind, part, name) in enumerate(channels):
        yield AblationCase(group, "one", kind, part, number, name, ablation([number]))
    numbers: dict[str, list[int]] = {}
    for number, (kind, _, _) in enumerate(channels):
        numbers.setdefault(kind, []).append(number)
    for kind, own in numbers.items():
        yield AblationCase(
            group, "kind", kind, None, None, f"all {kind}", ablation(own)
        )
    if channels:
        every = range(len(channels))
        yield AblationCase(group, "all", "", None, None, f"all {what}", ablation(every))


def inputs_of(robot: Robot, space: BodySpace) -> list[Channel]:
    """Return the inputs of a brain, in its order."""
    found: list[Channel] = []
    for index, part in enumerate(robot.parts):
        for sensor in space[part.kind].sensors:
            if not isinstance(sensor, Sensor):
                kind = type(sensor).__name__
                names = [f"{kind} {number}" for number in range(sensor.inputs)]
            elif sensor.kind == "imu":
                kind = sensor.kind
                names = [f"{what} {axis}" for what in _AXES for axis in "xyz"]
            else:
                kind = sensor.kind
                names = [kind if kind == "light" else f"{kind} {sensor.box}"]
            found += [(kind, index, f"{name} of part {index}") for name in names]
    return found


def motors_of(robot: Robot, space: BodySpace) -> list[Channel]:
    """Return the motors of a robot, in the order of the brain's outputs."""
    return [
        (part.kind, index, f"motor of part {index}")
        for index, part in enumerate(robot.parts)
        if space[part.kind].motor is not None
    ]
