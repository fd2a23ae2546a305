"""Noise of sensors and motors: drawn by whose it is and when, and by nothing else.

A number that is drawn depends on the origin (seed, run, island), the birth, the trial,
the number of the tick and the neuron; not on who else is there, on what was drawn
before, or on either standard deviation. So robots can be drawn for in any order, and
a snapshot has nothing to keep of it.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from schema.experiment.document import Simulation
from schema.experiment.identity import Origin
from schema.robot.ids import BirthId
from schema.robot.results import Floats
from worker.robot.controller import Widths

BLOCK_TICKS = 64
"""Ticks that are drawn at once: starting a generator takes longer than a draw."""
_PURPOSE = 11
"""No number of ``coordinator.evolution.random_streams.Purpose``: other streams."""


@dataclass(frozen=True, slots=True)
class Source:
    """What all noise of one place has in common.

    Attributes:
        simulation: holds the standard deviations.
        width: of every network.
        origin: of the place.
    """

    simulation: Simulation
    width: Widths
    origin: Origin

    @property
    def is_silent(self) -> bool:
        """Whether nothing is ever drawn."""
        return not (self.simulation.sensor_noise or self.simulation.actuator_noise)


class Noise:
    """What some robots' readings and outputs are changed by, tick by tick."""

    def __init__(
        self, source: Source, births: Sequence[BirthId], trial: int = 0
    ) -> None:
        """Draw nothing yet.

        Args:
            source: of the place.
            births: whose, a row for each.
            trial: which evaluation of theirs, from 0.
        """
        self._source = source
        self._births = births
        self._trial = trial
        self._block = -1
        self._drawn: list[tuple[Floats, Floats]] = []

    def blur(self, tick: int, readings: Floats) -> Floats:
        """Return what the networks get for what the sensors read.

        Args:
            tick: its number, counted from where the place's time begins.
            readings: (R, N), the first N <= I; they stay as they are.

        Returns:
            (R, N); the readings themselves if sensors have no noise.
        """
        if not self._source.simulation.sensor_noise:
            return readings
        added, _ = self._added(tick)
        return readings + added[:, : readings.shape[1]]

    def shake(self, tick: int, outputs: Floats) -> Floats:
        """Return what the motors get for what the networks put out.

        Args:
            tick: its number.
            outputs: (R, O), unclipped; they stay as they are.

        Returns:
            (R, O), unclipped; the outputs themselves if motors have no noise.
        """
        if not self._source.simulation.actuator_noise:
            return outputs
        _, added = self._added(tick)
        return outputs + added

    def _added(self, tick: int) -> tuple[Floats, Floats]:
        """Return what is added at a tick: to readings (R, I), to outputs (R, O)."""
        block, place = divmod(tick, BLOCK_TICKS)
        if block != self._block:
            self._draw(block)
        return self._drawn[place]

    def _draw(self, block: int) -> None:
        source, clock = self._source, self._source.simulation
        inputs, outputs = source.width.inputs, source.width.outputs
        numbers = np.empty((BLOCK_TICKS, len(self._births), inputs + outputs))
        for row, birth in enumerate(self._births):
            rng = _stream(source.origin, birth, self._trial, block)
            numbers[:, row] = rng.standard_normal((BLOCK_TICKS, inputs + outputs))
        on_readings = numbers[:, :, :inputs] * clock.sensor_noise
        on_outputs = numbers[:, :, inputs:] * clock.actuator_noise
        self._drawn = list(zip(on_readings, on_outputs, strict=True))
        self._block = block


def _stream(
    origin: Origin, birth: BirthId, trial: int, block: int
) -> np.random.Generator:
    """Return the stream of one robot's block of ticks.

    The origin is the key of a counter-based generator; the rest is where its counter
    starts. The lowest of the counter's words is left to the draws.

    Source: Salmon et al., Parallel random numbers: as easy as 1, 2, 3, 2011.
    """
    start = np.array(
        [0, block, birth.number, birth.island << 32 | trial], dtype=np.uint64
    )
    return np.random.Generator(np.random.Philox(key=_key(origin), counter=start))


@lru_cache(maxsize=64)
def _key(origin: Origin) -> int:
    """Return an origin's key, of 128 bits."""
    name = (origin.run, origin.island, 0, 0, _PURPOSE)
    words = np.random.SeedSequence(origin.seed, spawn_key=name)
    low, high = map(int, words.generate_state(2, np.uint64))
    return low | high << 64
