"""Bank of brains with code of users, in which a robot whose brain raises fails alone.

Brains are equal alone and in a batch, to the last bit, so if a batch raises, each
brain is computed alone.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from schema.plugins.protocols import Bank
from schema.robot.trace import Floats
from worker.robot.brains import Controls, outputs_of, story_of

_DIVERGED = "brain diverged: state not finite"


class GuardedBank:
    """Brains of R robots that are updated together; row r belongs to robot r.

    Attributes:
        failed: why brains failed at the last tick, by row; their outputs are 0.
    """

    def __init__(self, controls: Controls, packed: Sequence[Any]) -> None:
        """Initialise brains at rest.

        Args:
            controls: of the experiment.
            packed: brains in the form of their brain type.
        """
        self._controls, self._packed = controls, packed
        self._bank = controls.bank(packed)
        self.failed: dict[int, str] = {}

    @property
    def states(self) -> Floats:
        """All states, (R, K)."""
        return self._bank.states

    def step(self, readings: Floats, age_ticks: Floats | float) -> Floats:
        """Update all brains once; see ``schema.plugins.protocols.Bank``."""
        self.failed = {}
        before = self.states.copy()
        try:
            return self._outputs(self._bank.step(readings, age_ticks), len(readings))
        except Exception:  # noqa: BLE001 - any fault of a user's code
            return self._step_alone(before, readings, age_ticks)

    def _outputs(self, found: object, robots: int) -> Floats:
        return outputs_of(found, robots, self._controls.width.outputs)

    def _step_alone(
        self, before: Floats, readings: Floats, age_ticks: Floats | float
    ) -> Floats:
        """Update each brain alone, from the states before the tick."""
        count = len(self._packed)
        outputs = np.zeros((count, self._controls.width.outputs))
        ages = np.broadcast_to(age_ticks, (count, 1))
        for row, packed in enumerate(self._packed):
            one, bank = slice(row, row + 1), self._controls.bank([packed])
            bank.states[...] = before[one]
            try:
                outputs[one] = self._outputs(bank.step(readings[one], ages[one]), 1)
            except Exception as error:  # noqa: BLE001 - any fault of a user's code
                self.failed[row] = f"brain failed: {story_of(error)}"
            self.states[one] = bank.states
        return outputs


def guarded_bank(controls: Controls, packed: Sequence[Any]) -> Bank:
    """Return brains at rest that are updated together; guarded if code is a user's."""
    if controls.is_checked:
        return GuardedBank(controls, packed)
    return controls.bank(packed)


def broken_rows(bank: Bank, outputs: Floats) -> dict[int, str]:
    """Return why brains failed, or are no longer finite, by row, ascending.

    Args:
        bank: the brains after a tick.
        outputs: (R, O) of that tick.
    """
    if not isinstance(bank, GuardedBank):
        return {}
    is_finite = np.isfinite(bank.states).all(axis=1)
    is_finite &= np.isfinite(outputs).all(axis=1)
    diverged = dict.fromkeys(np.flatnonzero(~is_finite).tolist(), _DIVERGED)
    return dict(sorted((diverged | bank.failed).items()))
