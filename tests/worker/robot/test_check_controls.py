"""The check of brains in workers refuses each breach of the contract."""

from collections.abc import Callable, Sequence

import numpy as np
import pytest

from schema.errors import ExperimentError
from schema.experiment.brains import widths
from schema.experiment.document import Space
from schema.plugins.protocols import Bank
from schema.robot.brain import NEURON_TYPES, Brain, NeuronKinds
from schema.robot.trace import Floats
from worker.robot.check_controls import check_controls

Change = Callable[["Leaking", Floats, Floats], Floats]


class Leaking:
    """Bank whose outputs are sums of past readings, changed by a function."""

    def __init__(self, count: int, change: Change) -> None:
        self.states = np.full((count, 10), 0.25 if change is awake else 0.0)
        self.hidden = np.zeros((count, 10))
        self.ages: Floats | float = 0.0
        self._change = change

    def step(self, readings: Floats, age_ticks: Floats | float) -> Floats:
        self.ages = age_ticks
        self.states += readings
        self.hidden += readings
        return self._change(self, readings, self.states.copy())


def awake(_bank: Leaking, _readings: Floats, outputs: Floats) -> Floats:
    return outputs


def asks(bank: Leaking, readings: Floats, outputs: Floats) -> Floats:
    del readings
    return outputs if bank.ages > 3.0 else 0.5 * outputs


class Broken:
    """Brains of one broken type."""

    width = widths(Space())
    neurons: NeuronKinds = NEURON_TYPES

    def __init__(self, change: Change) -> None:
        self._change = change

    def pack(self, brain: Brain) -> Brain:
        return brain

    def bank(self, packed: Sequence[Brain]) -> Bank:
        return Leaking(len(packed), self._change)


def replaces(bank: Leaking, readings: Floats, outputs: Floats) -> Floats:
    del readings
    bank.states = 0.9 * bank.states
    return outputs


def raises(bank: Leaking, readings: Floats, outputs: Floats) -> Floats:
    del bank, readings
    raise KeyError(f"{outputs.shape[1]} motors")


CASES: dict[str, tuple[Change, str]] = {
    "shape": (lambda _, __, outputs: outputs[:, :3], r"must be .* shape \(7, 10\)"),
    "not finite": (lambda _, __, outputs: outputs / 0.0, "outputs: must be finite"),
    "other robots": (lambda _, readings, outputs: outputs + readings.max(), "alone"),
    "row": (
        lambda _, __, outputs: outputs + np.arange(len(outputs))[:, np.newaxis],
        "in another row",
    ),
    "memory": (lambda bank, _, __: bank.hidden.copy(), "states were restored"),
    "random": (
        lambda _, __, outputs: outputs + np.random.default_rng().random(),
        "a second time",
    ),
    "whole numbers": (
        lambda _, __, outputs: (outputs > 0.0).astype(np.int64),
        "outputs: must be float64 .* got int64",
    ),
    "single": (
        lambda _, __, outputs: outputs.astype(np.float32),
        "outputs: must be float64 .* got float32",
    ),
    "list": (lambda _, __, outputs: outputs.tolist(), "of float64, got a list"),
    "other array": (replaces, "states: must be changed in place"),
    "awake": (awake, "states: must be 0 at birth, got 0.25"),
    "ages of rows": (
        lambda bank, _, outputs: outputs + 0.1 * (np.shape(bank.ages) == (7, 1)),
        r"got other ones with an array \(R, 1\) of ages at tick 0",
    ),
}


@pytest.mark.parametrize("name", list(CASES))
@pytest.mark.filterwarnings("ignore:divide by zero", "ignore:invalid value")
def test_broken_brains_are_refused(name: str) -> None:
    change, message = CASES[name]
    with pytest.raises(ExperimentError, match=message):
        check_controls(Broken(change))


@pytest.mark.parametrize(("change", "error"), [(raises, KeyError), (asks, ValueError)])
def test_errors_of_the_code_pass(change: Change, error: type[Exception]) -> None:
    """Of one that takes the ages for a number, too."""
    with pytest.raises(error):
        check_controls(Broken(change))


def test_sound_brains_pass() -> None:
    check_controls(Broken(lambda _, __, outputs: outputs))
