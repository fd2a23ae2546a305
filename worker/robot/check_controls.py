"""Check of the half of a brain type that ticks, before it moves a robot."""

from collections.abc import Sequence
from typing import Any, Protocol

import numpy as np

from schema.plugins.contract import broken
from schema.plugins.protocols import Bank
from schema.robot.brain import (
    INPUT,
    LAYERS,
    Brain,
    Connection,
    Layer,
    Neuron,
    NeuronKinds,
    Widths,
)
from schema.robot.trace import Floats

_ROBOTS = 7
_TICKS = 12


class CheckedControls(Protocol):
    """Brains of one experiment; see ``worker.robot.brains``."""

    width: Widths
    neurons: NeuronKinds

    def pack(self, brain: Brain) -> Any:  # noqa: ANN401 - a brain type's own
        """Return a brain in the form that ``bank`` takes."""

    def bank(self, packed: Sequence[Any]) -> Bank:
        """Return brains at rest that are updated together."""


def check_controls(controls: CheckedControls) -> None:
    """Raise unless brains keep the contract of ``BrainControl`` on random brains.

    Raises:
        ExperimentError: states that are not 0 at birth or not changed in place;
            outputs or states of another type or shape, or not finite; a robot that
            moves differently a second time, alone, in another row, after its states
            were saved and restored, or if the ages are an array, as in an arena.
        Exception: any error of the code.
    """
    everybody = list(range(_ROBOTS))
    expected = _run(controls, everybody)
    for what, rows, moved_at, has_ages in (
        ("a second time", everybody, _TICKS, False),
        ("in another row", everybody[::-1], _TICKS, False),
        ("alone", [3], _TICKS, False),
        ("after its states were restored", everybody, _TICKS // 2, False),
        ("with an array (R, 1) of ages", everybody, _TICKS, True),
    ):
        ticks = zip(
            _run(controls, rows, moved_at, has_ages=has_ages), expected, strict=True
        )
        for tick, (outputs, expected_outputs) in enumerate(ticks):
            if outputs.tobytes() != expected_outputs[rows].tobytes():
                rule = "be equal for equal robots: use elementwise NumPy, arrays of "
                rule += "fixed width, and keep everything in `states`"
                raise broken("outputs", rule, came=f"other ones {what} at tick {tick}")


def _run(
    controls: CheckedControls,
    rows: Sequence[int],
    moved_at: int = _TICKS,
    *,
    has_ages: bool = False,
) -> list[Floats]:
    """Return outputs and states after each tick; restore them once on the way."""
    packed = [controls.pack(_brain(controls, number)) for number in rows]
    kept = controls.bank(()).states.shape[1]
    rng = np.random.default_rng(0)
    readings = rng.normal(0.0, 3.0, (_TICKS, _ROBOTS, controls.width.inputs))
    bank = controls.bank(packed)
    if bank.states.any():
        raise broken("states", "be 0 at birth", float(bank.states[bank.states != 0][0]))
    history: list[Floats] = []
    for tick in range(_TICKS):
        if tick == moved_at:
            states = bank.states.copy()
            bank = controls.bank(packed)
            bank.states[...] = states
        states = bank.states
        ages = np.full((len(rows), 1), float(tick)) if has_ages else float(tick)
        outputs = bank.step(readings[tick, rows], ages)
        # An arena keeps views of the rows, from which robots are saved and moved.
        if states.size and not np.shares_memory(states, bank.states):
            raise broken(
                "states", "be changed in place", came="another array after a step"
            )
        _require("outputs", outputs, (len(rows), controls.width.outputs))
        _require("states", bank.states, (len(rows), kept))
        history.append(np.hstack([outputs, bank.states]))
    return history


def _require(what: str, array: object, shape: tuple[int, int]) -> None:
    if not isinstance(array, np.ndarray):
        raise broken(what, "be an array of float64", came=f"a {type(array).__name__}")
    if array.dtype != np.float64 or array.shape != shape:
        came = f"{array.dtype} of shape {array.shape}"
        raise broken(what, f"be float64 of shape {shape}", came=came)
    if not np.isfinite(array).all():
        raise broken(what, "be finite", came=str(array[~np.isfinite(array)][0]))


def _brain(controls: CheckedControls, number: int) -> Brain:
    """Return a random brain of a fourth of the neurons to all of them."""
    rng = np.random.default_rng(number)
    width, kinds = controls.width, controls.neurons
    counts = (width.inputs, width.outputs, width.hidden)
    neurons: list[Neuron] = []
    for layer, most in zip(LAYERS, counts, strict=True):
        count = most * (1 + number % 4) // 4
        neurons += [_neuron(layer, part, kinds, rng) for part in range(count)]
    inputs = sum(neuron.layer == "input" for neuron in neurons)
    edges = tuple(
        Connection(source, target, float(rng.random()))
        for source in range(len(neurons))
        for target in range(inputs, len(neurons))
        if rng.random() < 0.3  # noqa: PLR2004 - some of them
    )
    return Brain(tuple(neurons), edges)


def _neuron(
    layer: Layer, part: int, kinds: NeuronKinds, rng: np.random.Generator
) -> Neuron:
    if layer == "input":
        return Neuron(layer, INPUT, part)
    name = list(kinds)[int(rng.integers(len(kinds)))]
    values = tuple(float(rng.uniform(p.low, p.high)) for p in kinds[name])
    return Neuron(layer, name, part, values)
