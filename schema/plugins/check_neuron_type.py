"""Check of a neuron type on random neurons, before it is used."""

import math
from functools import partial
from typing import Any

import numpy as np

from schema.errors import ExperimentError
from schema.limits import MOST_NEURON_PARAMETERS, MOST_NEURON_STATES
from schema.parts import Parameter
from schema.plugins.contract import broken, repeated
from schema.plugins.protocols import NeuronType
from schema.robot.brain import INPUT
from schema.robot.neurons import Tick
from schema.robot.trace import Floats

_COUNT = 101
_BATCHES = ((0, 1), (1, 3), (3, 10), (_COUNT - 1, _COUNT))
_TICKS = 20
_TICK_S = 0.125


def check_neuron_type(kind: NeuronType) -> None:
    """Raise unless a neuron type keeps its contract on random neurons.

    The neurons are computed for some ticks: all together, and in smaller batches.

    Raises:
        Exception: an error of its code, or ``ExperimentError`` for a broken rule.
    """
    _check_declaration(kind)
    rng = np.random.default_rng(0)
    ranges = [rng.uniform(p.low, p.high, _COUNT) for p in kind.parameters]
    parameters = np.array(ranges).reshape(-1, _COUNT)
    ages_s = rng.integers(0, 10_000, _COUNT).astype(np.float64) * _TICK_S
    state = np.zeros((kind.states, _COUNT))
    for number in range(_TICKS):
        inputs = rng.normal(0.0, 3.0, _COUNT)
        arguments = state, inputs, parameters, ages_s + number * _TICK_S
        state = _stepped(kind, *arguments)
        for first, last in _BATCHES:
            # Contiguous, as in workers: other layouts may have other rounding.
            batch = [np.ascontiguousarray(full[..., first:last]) for full in arguments]
            if not np.array_equal(_stepped(kind, *batch), state[:, first:last]):
                rule = "be equal for equal neurons: use elementwise NumPy only"
                raise broken("states", rule, came="other ones in a smaller batch")


def states_problem(state: object, shape: tuple[int, ...]) -> str:
    """Return what is wrong with states, which must be float64 (K, N); or nothing."""
    array = np.asarray(state)
    if array.shape == shape and array.dtype == np.float64:
        return ""
    came = f"{array.dtype} of shape {array.shape}"
    return str(broken("step", f"return float64 of shape (K, N) = {shape}", came=came))


def _check_declaration(kind: NeuronType) -> None:
    """Raise for a wrong name, parameter or number of states."""
    name: Any = kind.name
    if not (isinstance(name, str) and name.isidentifier()) or name == INPUT:
        raise broken("name", f"be an identifier other than {INPUT}", name)
    parameters: Any = kind.parameters
    is_tuple = isinstance(parameters, tuple)
    if not is_tuple or not all(isinstance(item, Parameter) for item in parameters):
        raise broken("parameters", "be a tuple of Parameter", parameters)
    if len(parameters) > MOST_NEURON_PARAMETERS:
        most = f"be <= {MOST_NEURON_PARAMETERS} parameters"
        raise broken("parameters", most, came=str(len(parameters)))
    for parameter in parameters:
        ends = (parameter.low, parameter.default, parameter.high)
        if not all(map(math.isfinite, ends)) or list(ends) != sorted(ends):
            raise broken(parameter.name, "be finite with low <= default <= high", ends)
    states: Any = kind.states
    if type(states) is not int or not 1 <= states <= MOST_NEURON_STATES:
        raise broken("states", f"be in 1..{MOST_NEURON_STATES}", states)


def _stepped(
    kind: NeuronType, state: Floats, inputs: Floats, parameters: Floats, ages_s: Floats
) -> Floats:
    """Return the states of some neurons after a tick, (K, N)."""
    arguments = state, inputs, parameters, Tick(ages_s, _TICK_S)
    after = repeated("step", partial(kind.step, *arguments), arguments)
    if problem := states_problem(after, state.shape):
        raise ExperimentError(problem)
    after = np.asarray(after)
    if not np.isfinite(after).all():
        raise broken("step", "return finite states", came=str(after.min()))
    return after
