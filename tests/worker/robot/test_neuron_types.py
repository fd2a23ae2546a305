"""Neuron types of users, beside the built-in ones."""

from collections.abc import Callable

import numpy as np
import pytest

from schema.errors import InvalidRobot
from schema.experiment.brains import NoParameters, widths
from schema.experiment.document import NETWORK, Space
from schema.parts import Parameter
from schema.plugins.protocols import NeuronType
from schema.robot.brain import INPUT, NEURON_TYPES, Brain, Connection, Neuron
from schema.robot.neurons import BUILT_IN_NEURONS, Tick
from schema.robot.trace import Floats
from worker.robot.banks import GuardedBank, NetworkBank, broken_rows
from worker.robot.brains import Controls, NetworkControl, pack, solo_brain
from worker.robot.own_neurons import STATE_LIMIT

WIDTH = widths(Space())
TICK_S = 0.125
MIXED = Space(neuron_types=("Simple", "my_brains:Adapting", "Oscillator"))
own = pytest.mark.usefixtures("_own_brains")


def random_brain(seed: int, kinds: dict[str, int]) -> Brain:
    """Return a full network; kinds: parameters per neuron type."""
    rng = np.random.default_rng(seed)
    layers = ["input"] * 10 + ["output"] * 10 + ["hidden"] * 10
    names = [list(kinds)[int(rng.integers(len(kinds)))] for _ in layers]
    neurons = tuple(
        Neuron("input", INPUT, 0)
        if layer == "input"
        else Neuron(
            "output" if layer == "output" else "hidden",
            name,
            0,
            tuple(rng.uniform(0.1, 1.0, kinds[name]).tolist()),
        )
        for layer, name in zip(layers, names, strict=True)
    )
    edges = tuple(
        Connection(source, target, float(rng.normal()))
        for source in range(30)
        for target in range(10, 30)
        if rng.random() < 0.2
    )
    return Brain(neurons, edges)


@pytest.mark.parametrize("kind", list(NEURON_TYPES))
def test_built_in_types_compute_what_networks_compute(kind: str) -> None:
    """The objects are the oracle of the batched arithmetic, up to rounding."""
    count = len(NEURON_TYPES[kind])
    brain = random_brain(3, {kind: count})
    bank = NetworkBank([pack(brain, WIDTH)], WIDTH, TICK_S)
    weights = np.zeros((20, 30))
    for edge in brain.connections:
        weights[edge.target - 10, edge.source] = edge.weight
    parameters = np.array([n.parameters for n in brain.neurons[10:]]).T
    state = np.zeros((1, 20))
    rng = np.random.default_rng(0)
    for tick in range(8):
        readings = rng.normal(0.0, 1.0, (1, 10))
        inputs = weights @ np.concatenate([readings[0], state[0]])
        now = Tick(np.full(20, tick * TICK_S), TICK_S)
        state = BUILT_IN_NEURONS[kind].step(state, inputs, parameters, now)
        bank.step(readings, float(tick))
        assert bank.states[0] == pytest.approx(state[0], rel=1e-12, abs=1e-12)


@own
def test_an_adapting_neuron_by_hand() -> None:
    brain = Brain(
        (
            Neuron("input", INPUT, 0),
            Neuron("output", "Adapting", 0, (0.25, 2.0, 0.5)),
            Neuron("hidden", "Simple", 0, (0.0, 1.0)),
        ),
        (Connection(0, 1, 0.5), Connection(1, 2, 1.0)),
    )
    solo = solo_brain(Controls(NETWORK, MIXED, TICK_S), brain, 5)
    readings = np.zeros((1, 10))
    readings[0, 0] = 2.0
    found = [float(solo.step(readings, float(tick))[0, 0]) for tick in range(3)]
    # Half of the way to 1 + 0.5 - 2 tired; tired follows by a tenth.
    first, second = 0.75, 0.75 + 0.5 * (1.5 - 0.15 - 0.75)
    third = 1.05 + 0.5 * (1.5 - 2 * 0.1725 - 1.05)
    assert found == pytest.approx([first, second, third])


@own
def test_own_neurons_are_independent_of_the_batch_and_can_be_moved() -> None:
    controls = Controls(NETWORK, MIXED, TICK_S)
    kinds = {"Simple": 2, "Adapting": 3, "Oscillator": 3}
    packed = [controls.pack(random_brain(seed, kinds)) for seed in range(30)]
    rng = np.random.default_rng(1)
    readings = rng.normal(0.0, 5.0, (40, 30, 10))
    ages = rng.integers(0, 1000, (30, 1)).astype(float)
    batch, alone = controls.bank(packed), [controls.bank([one]) for one in packed]
    assert controls.rest().shape == batch.states[0].shape == (60,)
    for tick in range(40):
        if tick == 20:
            states = batch.states.copy()
            batch = controls.bank(packed)
            batch.states[...] = states
        together = batch.step(readings[tick], ages + tick)
        for row, bank in enumerate(alone):
            single = bank.step(
                readings[tick, row : row + 1], float(ages[row, 0] + tick)
            )
            assert single.tobytes() == together[row].tobytes()
            assert bank.states.tobytes() == batch.states[row].tobytes()
    assert np.abs(batch.states[:, 20:]).max() > 0.1, "potential and tiredness are kept"


@own
def test_a_robot_of_built_in_neurons_only_costs_nothing_more() -> None:
    controls = Controls(NETWORK, MIXED, TICK_S)
    simple = Neuron("output", "Simple", 0, (0.0, 1.0))
    solo = solo_brain(controls, Brain((simple,)), 3)
    assert type(solo).__name__ == "SoloNetwork"
    zeros = np.zeros((1, 10))
    assert solo_brain(controls, Brain(), 3).step(zeros, 0.0).shape == (1, 10)


def test_a_neuron_of_another_type_is_refused() -> None:
    controls = Controls(NETWORK, Space(neuron_types=("Sigmoid",)), TICK_S)
    brain = Brain((Neuron("output", "Simple", 0, (0.0, 1.0)),))
    with pytest.raises(InvalidRobot, match="must be one of Sigmoid, got 'Simple'"):
        controls.pack(brain)
    short = Brain((Neuron("output", "Sigmoid", 0, (0.0,)),))
    with pytest.raises(InvalidRobot, match="Sigmoid takes 2, got 1"):
        controls.pack(short)


class Growing:
    """Neuron that grows, at once after a second."""

    name = "Growing"
    parameters: tuple[Parameter, ...] = ()
    states = 2

    def step(
        self, state: Floats, inputs: Floats, parameters: Floats, tick: Tick
    ) -> Floats:
        del inputs, parameters
        return state * 4.0 + 1.0 + np.where(tick.age_s > 1.0, np.inf, 0.0)


def test_all_states_are_clipped() -> None:
    brain = Brain((Neuron("output", "Growing", 0),))
    control = NetworkControl(NoParameters(), (Growing(),))
    bank = control.bank([control.pack(brain, WIDTH)], WIDTH, TICK_S)
    for tick in range(20):
        outputs = bank.step(np.zeros((1, 10)), float(tick))
    assert outputs[0, 0] == bank.states[0, 0] == bank.states[0, 20] == STATE_LIMIT


def reason_of(kind: NeuronType) -> str:
    """Return why a neuron of a user's type that lives alone fails at tick 1."""
    control = NetworkControl(NoParameters(), (kind,))
    brain = Brain((Neuron("output", kind.name, 0),))
    bank = GuardedBank(
        lambda packed: control.bank(packed, WIDTH, TICK_S),
        [control.pack(brain, WIDTH)],
        WIDTH.outputs,
    )
    readings = np.zeros((1, WIDTH.inputs))
    assert not broken_rows(bank, bank.step(readings, 0.0))
    return broken_rows(bank, bank.step(readings, 1.0))[0]


class Turning:
    """Neuron whose states are of another form after the first tick."""

    name = "Turning"
    parameters: tuple[Parameter, ...] = ()
    states = 2

    def __init__(self, form: Callable[[Floats], Floats]) -> None:
        self._form = form

    def step(
        self, state: Floats, inputs: Floats, parameters: Floats, tick: Tick
    ) -> Floats:
        del inputs, parameters
        return self._form(state + 0.25) if tick.age_s.max() else state + 0.25


@pytest.mark.parametrize(
    ("form", "got"),
    [
        (lambda found: found.astype(np.float32), "float32 of shape (2, 1)"),
        (lambda found: found + 1j, "complex128 of shape (2, 1)"),
        (lambda found: found[0], "float64 of shape (1,)"),
        (lambda _: 0.5, "float64 of shape ()"),
    ],
)
def test_states_of_another_form_are_a_failed_result(
    form: Callable[[Floats], Floats], got: str
) -> None:
    assert reason_of(Turning(form)) == (
        "brain failed: neuron type Turning: step: must return float64 "
        f"of shape (K, N) = (2, 1), got {got}"
    )
