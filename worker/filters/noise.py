"""Noise of sensors and motors, from counter-based random streams.

Each draw depends only on the origin (seed, run, island), the birth, the trial, the
number of the tick and the neuron; not on other robots, on earlier draws, or on either
standard deviation. Robots can therefore be served in any order, and a snapshot needs
no state of the generator.
"""

from collections.abc import Sequence

import numpy as np

from schema.experiment.document import Simulation
from schema.experiment.identity import Origin
from schema.robot.brain import Widths
from schema.robot.ids import BirthId
from schema.robot.trace import Floats
from worker.filters.random_streams import DrawPurpose, stream

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
