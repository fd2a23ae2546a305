"""The brains of all robots of an arena, ticking in one batch.

A robot's first tick is at its birth, as off-line; births happen between two ticks
of the arena, so from then on all tick together.
"""

from collections.abc import Sequence

import numpy as np

from schema.experiment import Simulation
from worker.controller import Bank, Widths
from worker.inhabitant import Inhabitant


class Minds:
    """One bank of networks, a row for each inhabitant, by birth."""

    def __init__(self, width: Widths, simulation: Simulation) -> None:
        """Start with nobody.

        Args:
            width: of every network.
            simulation: its clocks.
        """
        self._width = width
        self._tick_steps = simulation.brain_steps
        self._tick_s = simulation.brain_steps * simulation.timestep_s
        self._everybody: tuple[Inhabitant, ...] = ()
        self._ages = np.zeros((0, 1))
        self._bank: Bank | None = None

    def gather(self, everybody: Sequence[Inhabitant]) -> None:
        """Make the bank anew; each keeps its states, now a row of the bank."""
        self._everybody = tuple(everybody)
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

    def tick(self, step: int) -> None:
        """Let all think of what they last felt, and command their motors."""
        if self._bank is None:
            return
        readings = np.concatenate(
            [inhabitant.seat.senses.readings for inhabitant in self._everybody]
        )
        ages = (step - self._ages) // self._tick_steps
        outputs = self._bank.step(readings, ages)
        for inhabitant, output in zip(self._everybody, outputs, strict=True):
            inhabitant.seat.drive(output)

    def first_tick(self, inhabitant: Inhabitant) -> None:
        """Let a newborn think alone, before it joins the bank."""
        bank = Bank([inhabitant.network], self._width, self._tick_s)
        outputs = bank.step(inhabitant.seat.senses.readings, 0.0)
        inhabitant.states = bank.states[0]
        inhabitant.seat.drive(outputs[0])
