"""Check of a neuron type on small cases, before it is used."""

import math
from typing import Any

import numpy as np
import numpy.typing as npt

from schema.errors import ExperimentError, error_text
from schema.limits import MOST_NEURON_PARAMETERS, MOST_NEURON_STATES
from schema.parts import Parameter
from schema.plugins.origin import where_defined
from schema.plugins.protocols import NeuronType
from schema.robot.brain import INPUT
from schema.robot.neurons import Tick
from schema.robot.results import Floats

_BATCH = 101
_TICKS = 20
_TICK_S = 0.125


def check_neuron_type(kind: NeuronType, where: str) -> None:
    """Raise unless a neuron type keeps its contract on random neurons.

    The neurons are computed for some ticks: all together, twice, and in smaller
    batches. Equal neurons must have equal states.

    Args:
        kind: the neuron type.
        where: the key that names it, for messages.

    Raises:
        ExperimentError: a wrong name, parameter or number of states; a step that
            raises, gives another shape or a number that is not finite, changes its
            arguments, or gives a neuron another state in another batch.
    """
    place = f"{where}: {where_defined(kind)}"
    if problem := _declaration_problem(kind):
        raise ExperimentError(f"{place}: expected {problem}")
    rng = np.random.default_rng(0)
    ranges = [rng.uniform(each.low, each.high, _BATCH) for each in kind.parameters]
    parameters = np.array(ranges).reshape(-1, _BATCH)
    inputs = rng.normal(0.0, 3.0, (_TICKS, _BATCH))
    ages = rng.integers(0, 10_000, _BATCH).astype(np.float64) * _TICK_S
    cases = parameters, inputs, ages
    expected = _states(kind, cases, np.arange(_BATCH), place)
    for first, last in ((0, _BATCH), (0, 1), (1, 3), (3, 10), (_BATCH - 1, _BATCH)):
        chosen = np.arange(first, last)
        found = _states(kind, cases, chosen, place)
        if not np.array_equal(found, expected[:, :, chosen]):
            what = "second time" if len(chosen) == _BATCH else "smaller batch"
            raise ExperimentError(
                f"{place}: expected equal states for equal neurons, got other ones in "
                f"a {what}: use elementwise NumPy and no state of its own"
            )


def states_problem(found: npt.NDArray[np.generic], expected: tuple[int, ...]) -> str:
    """Return what is expected of the states that a step returns, and what came.

    Args:
        found: the states.
        expected: shape, (K, N).

    Returns:
        A part of a message; empty for float64 of this shape.
    """
    if found.shape == expected and found.dtype == np.float64:
        return ""
    return (
        f"expected step to return float64 of shape (K, N) = {expected}, got "
        f"{found.dtype} of shape {found.shape}"
    )


def _declaration_problem(kind: NeuronType) -> str:
    """Return what is expected of a name, parameters and number of states, and came."""
    name: Any = kind.name
    if not (isinstance(name, str) and name.isidentifier()) or name == INPUT:
        return f"a name that is an identifier other than {INPUT}, got {name!r}"
    parameters: Any = kind.parameters
    is_tuple = isinstance(parameters, tuple)
    if not is_tuple or not all(isinstance(each, Parameter) for each in parameters):
        return f"parameters as a tuple of Parameter, got {parameters!r}"
    if len(parameters) > MOST_NEURON_PARAMETERS:
        return f"<= {MOST_NEURON_PARAMETERS} parameters, got {len(parameters)}"
    for each in parameters:
        ends = (each.low, each.default, each.high)
        if not all(map(math.isfinite, ends)) or list(ends) != sorted(ends):
            return (
                f"low <= default <= high, finite, of {each.name!r}, got "
                f"{each.low}, {each.default}, {each.high}"
            )
    states: Any = kind.states
    if type(states) is not int or not 1 <= states <= MOST_NEURON_STATES:
        return f"states in 1..{MOST_NEURON_STATES}, got {states!r}"
    return ""


def _states(
    kind: NeuronType,
    cases: tuple[Floats, Floats, Floats],
    chosen: npt.NDArray[np.int_],
    place: str,
) -> Floats:
    """Return the states of some neurons after each tick, (T, K, N)."""
    # Contiguous, as in workers: other layouts may have other rounding.
    parameters, inputs, ages = (
        np.ascontiguousarray(each[..., chosen]) for each in cases
    )
    state = np.zeros((kind.states, len(chosen)))
    found = []
    for number, row in enumerate(inputs):
        tick = Tick(ages + number * _TICK_S, _TICK_S)
        arguments = (state, row, parameters, tick.age_s)
        before = [each.copy() for each in arguments]
        try:
            after = np.asarray(kind.step(state, row, parameters, tick))
        except Exception as error:
            raise ExperimentError(
                f"{place}: expected step(state, inputs, parameters, tick), got "
                f"{error_text(error)}"
            ) from error
        if problem := states_problem(after, state.shape):
            raise ExperimentError(f"{place}: {problem}")
        if not np.isfinite(after).all():
            raise ExperimentError(f"{place}: expected finite states, got {after.min()}")
        if not all(map(np.array_equal, arguments, before)):
            raise ExperimentError(f"{place}: expected step to change no argument")
        state = after
        found.append(after)
    return np.array(found)
