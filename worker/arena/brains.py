"""The brains of all robots of an arena, ticking in one batch.

A robot's first tick is at its birth, as off-line; births happen between two ticks
of the arena, so from then on all tick together.
"""

from collections.abc import Sequence

import numpy as np

from schema.robot.results import Floats
from worker.clusters.robot import ArenaRobot
from worker.robot.controller import Bank
from worker.robot.noise import Noise, Source


class BatchedControllers:
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

    def gather(self, everybody: Sequence[ArenaRobot]) -> None:
        """Make the bank anew; each keeps its states, now a row of the bank."""
        if not everybody:
            self._bank = None
            return
        networks = [arena_robot.network for arena_robot in everybody]
        self._bank = Bank(networks, self._width, self._tick_s)
        for row, arena_robot in enumerate(everybody):
            self._bank.states[row] = arena_robot.states
            arena_robot.states = self._bank.states[row]
        since = [arena_robot.thinks_since for arena_robot in everybody]
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

    def first_tick(self, step: int, arena_robot: ArenaRobot) -> None:
        """Let a newborn think alone, before it joins the bank.

        Args:
            step: the arena's.
            arena_robot: who.
        """
        bank = Bank([arena_robot.network], self._width, self._tick_s)
        noise = Noise(self._source, (arena_robot.birth,))
        tick = step // self._tick_steps
        readings = noise.blur(tick, arena_robot.view.senses.readings)
        outputs = noise.shake(tick, bank.step(readings, 0.0))
        arena_robot.states = bank.states[0]
        arena_robot.view.drive(outputs[0])
