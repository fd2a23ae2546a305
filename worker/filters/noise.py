"""Noise and pushes, from counter-based random streams without state to save.

Each draw depends only on the purpose, the origin (seed, run, island), the birth, the
trial, the number of the tick and the neuron; not on other robots, on earlier draws, or
on either standard deviation. Robots can therefore be served in any order, and a
snapshot needs no state of the generator.
"""

from collections.abc import Sequence
from enum import IntEnum
from functools import lru_cache
from math import cos, pi, sin
from typing import cast

import mujoco
import numpy as np

from schema.experiment.document import Simulation
from schema.experiment.environment import Environment
from schema.experiment.identity import Identity, Origin
from schema.robot.brain import Widths
from schema.robot.ids import BirthId
from schema.robot.trace import Floats


class DrawPurpose(IntEnum):
    """Purposes; they differ from those of ``coordinator.evolution.random_streams``."""

    NOISE = 11
    PUSHES = 12
    DISTURBANCES = 13


def stream(
    purpose: DrawPurpose, origin: Origin, birth: BirthId, trial: int, block: int = 0
) -> np.random.Generator:
    """Return the stream of a block of one robot's draws for a purpose.

    The origin is the key of a counter-based generator. Birth, trial and block are the
    start of its counter; the counter's lowest word belongs to the draws.

    Source: Salmon et al., Parallel random numbers: as easy as 1, 2, 3, 2011.
    """
    start = np.array(
        [0, block, birth.number, birth.island << 32 | trial], dtype=np.uint64
    )
    key = _key(purpose, origin)
    return np.random.Generator(np.random.Philox(key=key, counter=start))


@lru_cache(maxsize=64)
def _key(purpose: DrawPurpose, origin: Origin) -> int:
    """Return the key of a purpose and an origin, of 128 bits."""
    name = (origin.run, origin.island, 0, 0, int(purpose))
    words = np.random.SeedSequence(origin.seed, spawn_key=name)
    low, high = map(int, words.generate_state(2, np.uint64))
    return low | high << 64


BLOCK_TICKS = 64
"""Ticks that are drawn at once, because starting a generator costs more than a draw."""


class Noise:
    """Additive Gaussian noise on the readings and outputs of R robots."""

    def __init__(
        self,
        simulation: Simulation,
        width: Widths,
        origin: Origin,
        births: Sequence[BirthId],
        trial: int = 0,
        *,
        further: tuple[Floats, Floats] | None = None,
    ) -> None:
        """Initialise the streams.

        ``further`` are standard deviations of further noise on each reading, (I,), and
        on each output, (O,).
        """
        self._width, self._origin = width, origin
        self._on_readings: float | Floats = simulation.sensor_noise
        self._on_outputs: float | Floats = simulation.actuator_noise
        if further is not None:
            # Standard deviations of sums of two independent noises.
            self._on_readings = np.hypot(simulation.sensor_noise, further[0])
            self._on_outputs = np.hypot(simulation.actuator_noise, further[1])
        self._births = births
        self._trial = trial
        self._block = -1
        self._drawn: list[tuple[Floats, Floats]] = []

    def readings(self, tick: int, values: Floats) -> Floats:
        """Return readings (R, N), the first N <= I, with the sensor noise, if any."""
        if not np.any(self._on_readings):
            return values
        added, _ = self._added(tick)
        return values + added[:, : values.shape[1]]

    def outputs(self, tick: int, values: Floats) -> Floats:
        """Return outputs (R, O), unclipped, with the actuator noise, if any."""
        if not np.any(self._on_outputs):
            return values
        _, added = self._added(tick)
        return values + added

    def _added(self, tick: int) -> tuple[Floats, Floats]:
        """Return the noise of a tick: on readings (R, I), on outputs (R, O)."""
        block, place = divmod(tick, BLOCK_TICKS)
        if block != self._block:
            self._draw(block)
        return self._drawn[place]

    def _draw(self, block: int) -> None:
        inputs, outputs = self._width.inputs, self._width.outputs
        numbers = np.empty((BLOCK_TICKS, len(self._births), inputs + outputs))
        for row, birth in enumerate(self._births):
            rng = stream(DrawPurpose.NOISE, self._origin, birth, self._trial, block)
            numbers[:, row] = rng.standard_normal((BLOCK_TICKS, inputs + outputs))
        on_readings = numbers[:, :, :inputs] * self._on_readings
        on_outputs = numbers[:, :, inputs:] * self._on_outputs
        self._drawn = list(zip(on_readings, on_outputs, strict=True))
        self._block = block


class Pushes:
    """Pushes on one robot.

    A push is a constant force at the centre of mass of the core's segment, from one
    brain tick to the next. Its impulse is ``environment.push_impulse``. Its direction
    in the ground plane is uniform and depends only on the identity of the evaluation
    and on the number of the push. The first push comes after one interval.
    """

    def __init__(
        self,
        environment: Environment,
        simulation: Simulation,
        identity: Identity,
        model: mujoco.MjModel,
        data: mujoco.MjData,
    ) -> None:
        tick_s = simulation.tick_s
        self._every = max(1, round(environment.push_interval_s / tick_s))
        steps = simulation.evaluation_steps
        count = steps // simulation.brain_steps // self._every + 1
        rng = stream(
            DrawPurpose.PUSHES, identity.origin, identity.birth, identity.trial
        )
        angles = rng.uniform(0.0, 2.0 * pi, count).tolist()
        force = environment.push_impulse / tick_s
        self._forces = [(force * cos(each), force * sin(each)) for each in angles]
        row = data.xfrc_applied[model.body("root").id]
        self._applied = cast("memoryview[float]", row.data)

    def readings(self, _tick: int, values: Floats) -> Floats:
        """Return the readings, which pushes do not change."""
        return values

    def outputs(self, tick: int, values: Floats) -> Floats:
        """Set the force on the robot until the next tick; return the outputs."""
        number, since = divmod(tick, self._every)
        is_push = number > 0 and since == 0
        fx, fy = self._forces[number - 1] if is_push else (0.0, 0.0)
        self._applied[0], self._applied[1] = fx, fy
        return values
