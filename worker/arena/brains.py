"""The brains of all robots of an arena, ticking in one batch.

A robot's first tick is at its birth, as off-line; births happen between two ticks
of the arena, so from then on all tick together.
"""

from collections.abc import Sequence

import numpy as np

from schema.robot.results import Floats
from worker.clusters.robot import Inhabitant
from worker.robot.controller import Bank
from worker.robot.noise import Noise, Source


class Minds:
    """One bank of networks, a row for each inhabitant, by birth."""

    def __init__(self, source: Source) -> None:
        """Start with nobody.

        Args:
            source: of noise; knows the width of every network, and the clocks.
        """
        simulation = source.simulation
        self._source = source
        self._noise = Noise(source, ())
        self._width = source.width
        self._tick_steps = simulation.brain_steps
        self._tick_s = simulation.brain_steps * simulation.timestep_s
        self._ages = np.zeros((0, 1))
        self._bank: Bank | None = None

    def gather(self, everybody: Sequence[Inhabitant]) -> None:
        """Make the bank anew; each keeps its states, now a row of the bank."""
        if not everybody:
            self._bank = None
            return
        networks = [inhabitant.network for inhabitant in everybody]
        self._bank = Bank(networks, self._width, self._tick_s)
        for row, inhabitant in enumerate(everybody):
            self._bank.states[row] = inhabitant.states
            inhabitant.states = self._bank.states[row]
        since = [inhabitant.thinks_since for inhabitant in everybody]
        self._ages = np.array(since, dtype=np.float64)[:, None]
        self._noise = Noise(self._source, [one.birth for one in everybody])

    def tick(self, step: int, readings: Floats) -> Floats:
        """Let all think of what they last felt.

        Args:
            step: the arena's.
            readings: (R, I) by birth.

        Returns:
            (R, O) what goes to the motors, perhaps a view that the next tick
            overwrites.
        """
        if self._bank is None:
            return np.zeros((0, self._width.outputs))
        ages = (step - self._ages) // self._tick_steps
        tick = step // self._tick_steps
        outputs = self._bank.step(self._noise.blur(tick, readings), ages)
        return self._noise.shake(tick, outputs)

    def first_tick(self, step: int, inhabitant: Inhabitant) -> None:
        """Let a newborn think alone, before it joins the bank.

        Args:
            step: the arena's.
            inhabitant: who.
        """
        bank = Bank([inhabitant.network], self._width, self._tick_s)
        noise = Noise(self._source, (inhabitant.birth,))
        tick = step // self._tick_steps
        readings = noise.blur(tick, inhabitant.seat.senses.readings)
        outputs = noise.shake(tick, bank.step(readings, 0.0))
        inhabitant.states = bank.states[0]
        inhabitant.seat.drive(outputs[0])
