"""Check of the half of a brain type that ticks, before it moves a robot."""

from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, Protocol

import numpy as np

from schema.errors import ExperimentError, error_text
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
from schema.robot.results import Floats

_ROBOTS = 7
_TICKS = 12


class Controls(Protocol):
    """Brains of one experiment; see ``worker.robot.brains``."""

    width: Widths
    neurons: NeuronKinds

    def pack(self, brain: Brain) -> Any:  # noqa: ANN401 - a brain type's own
        """Return a brain in the form that ``bank`` takes."""

    def bank(self, packed: Sequence[Any]) -> Bank:
        """Return brains at rest that are updated together."""


def check_controls(controls: Controls, place: str) -> None:
    """Raise unless brains keep the contract of ``BrainControl`` on random brains.

    Args:
        controls: the brains.
        place: where their code is, for messages.

    Raises:
        ExperimentError: code that raises; states or outputs of a wrong shape or not
            finite; a robot that moves differently a second time, alone, in another
            row, or after its states were saved and restored.
    """
    everybody = list(range(_ROBOTS))
    expected = _guarded(partial(_run, controls, everybody), place)
    for what, rows, moved_at in (
        ("a second time", everybody, _TICKS),
        ("in another row", everybody[::-1], _TICKS),
        ("alone", [3], _TICKS),
        ("after its states were restored", everybody, _TICKS // 2),
    ):
        found = _guarded(partial(_run, controls, rows, moved_at), place)
        _require_equal(found, [each[rows] for each in expected], place, what)


def check_new_controls(controls: Controls, place: str) -> None:
    """Raise unless brains also keep what versions before did not check.

    Runs begun by them go on, so this is for new runs.

    Args:
        controls: brains that pass ``check_controls``.
        place: where their code is, for messages.

    Raises:
        ExperimentError: states that are not 0 at birth or not changed in place;
            outputs that are no array of float64; code that raises, or robots that move
            differently, if the ages are an array, as in an arena.
    """
    run = partial(_run, controls, range(_ROBOTS), is_new=True)
    expected = _guarded(run, place)
    what = "with an array (R, 1) of ages"
    found = _guarded(partial(run, has_ages=True), place, f" {what}")
    _require_equal(found, expected, place, what)


def _run(
    controls: Controls,
    rows: Sequence[int],
    moved_at: int = _TICKS,
    *,
    is_new: bool = False,
    has_ages: bool = False,
) -> list[Floats]:
    """Return outputs and states after each tick; restore them once on the way.

    Args:
        controls: the brains.
        rows: numbers of the robots.
        moved_at: tick before which the states are restored; none if there is no such.
        is_new: also require what only brains of new runs must keep.
        has_ages: the ages are an array, not one number.
    """
    packed = [controls.pack(_brain(controls, number)) for number in rows]
    kept = controls.bank(()).states.shape[1]
    rng = np.random.default_rng(0)
    readings = rng.normal(0.0, 3.0, (_TICKS, _ROBOTS, controls.width.inputs))
    bank = controls.bank(packed)
    if is_new:
        _require_rest(bank.states)
    found: list[Floats] = []
    for tick in range(_TICKS):
        if tick == moved_at:
            states = bank.states.copy()
            bank = controls.bank(packed)
            bank.states[...] = states
        states = bank.states
        ages = np.full((len(rows), 1), float(tick)) if has_ages else float(tick)
        outputs = bank.step(readings[tick, rows], ages)
        if is_new:
            _require_in_place(states, bank.states)
            _require_floats(outputs)
        _require("outputs", outputs, (len(rows), controls.width.outputs))
        _require("states", bank.states, (len(rows), kept))
        found.append(np.hstack([outputs, bank.states]))
    return found


def _require_equal(
    found: Sequence[Floats], expected: Sequence[Floats], place: str, what: str
) -> None:
    """Raise unless outputs and states are equal to the last bit at each tick."""
    for tick, (one, other) in enumerate(zip(found, expected, strict=True)):
        if one.tobytes() != other.tobytes():
            raise ExperimentError(
                f"{place}: expected equal outputs and states for equal robots, got "
                f"other ones {what} at tick {tick}: use elementwise NumPy, arrays "
                "of fixed width, and keep everything in `states`"
            )


def _require_rest(states: Floats) -> None:
    """Raise unless states are 0 at birth, as arenas start new brains."""
    if states.any():
        first = float(states[states != 0.0][0])
        raise ValueError(f"`states` must be 0 at birth, got {first:g}")


def _require_in_place(before: Floats, after: Floats) -> None:
    """Raise unless states are the same array after a step.

    An arena keeps views of the rows, from which robots are saved and moved.
    """
    if before.size and not np.shares_memory(before, after):
        raise ValueError("`states` is another array after a step: change it in place")


def _require_floats(outputs: object) -> None:
    """Raise unless outputs are an array of float64, as arenas compute with them."""
    if not isinstance(outputs, np.ndarray):
        kind = f"a {type(outputs).__name__}"
    elif outputs.dtype != np.float64:
        kind = f"one of {outputs.dtype}"
    else:
        return
    raise TypeError(f"outputs must be an array of float64, got {kind}")


def _require(what: str, array: Floats, shape: tuple[int, int]) -> None:
    """Raise unless an array has a shape and is finite."""
    if np.shape(array) != shape:
        raise ValueError(f"{what} of shape {np.shape(array)}, not {shape}")
    if not np.isfinite(array).all():
        raise ValueError(f"{what} that are not finite")


def _guarded(
    compute: Callable[[], list[Floats]], place: str, what: str = ""
) -> list[Floats]:
    """Return what a plug-in computes; its exceptions become one line."""
    try:
        return compute()
    except Exception as error:
        raise ExperimentError(
            f"{place}: expected pack, bank and step as in BrainControl{what}, got "
            f"{error_text(error)}"
        ) from error


def _brain(controls: Controls, number: int) -> Brain:
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
    values = tuple(float(rng.uniform(each.low, each.high)) for each in kinds[name])
    return Neuron(layer, name, part, values)
