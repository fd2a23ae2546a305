"""Parameters of a brain as shares of their ranges, and back into genomes."""

from typing import Any

import numpy as np
import pytest

from coordinator.evolution.encodings import encoding_of
from coordinator.evolution.learners.brain_parameters import BrainParameters
from schema.experiment.document import (
    NETWORK,
    BrainSection,
    Experiment,
    Space,
    body_space,
)
from schema.experiment.learning import Learning
from schema.robot.brain import Brain, Connection, Neuron
from schema.robot.ids import BirthId
from schema.robot.inverse_development import with_brain
from schema.robot.robot import Part, Robot
from schema.wire.genome_bytes import encode_genome
from schema.wire.protobuf import decode_genome
from tests.coordinator.breeding import candidate
from tests.schema.robots import GREY

EXPERIMENT = Experiment(name="test")
BRAIN = Brain(
    (
        Neuron("input", "Input", 0),
        Neuron("output", "Sigmoid", 1, (-0.5, 0.25)),
        Neuron("hidden", "Oscillator", 0, (2.5, 3.14, 0.5)),
    ),
    (Connection(0, 1, 0.125), Connection(2, 1, 1.5)),
)
"""Bias from -1 to 1, period to 10, phase to 3.14, amplitude to 2; one odd weight."""
MODULAR = BrainSection(type="modular")
ROOM = Space(max_hidden=60)


def robot(brain: Brain, *genes: int) -> Robot:
    """Return a robot with a brain and a hinge of each gene behind the core's."""
    core, *hinges = genes or (1, 2)
    parts = [Part("Core", -1, -1, -1, 0, GREY, core)]
    for at, gene in enumerate(hinges):
        parts.append(Part("ActiveHinge", at, 1 if at else 0, 0, 0, GREY, gene))
    return Robot(tuple(parts), brain)


def parameters(brain: BrainSection = NETWORK, **keys: Any) -> BrainParameters:  # noqa: ANN401 - any key
    return BrainParameters(Learning(**keys), brain, ROOM)


@pytest.mark.parametrize(
    ("what", "shares"),
    [
        ("all", (0.25, 0.25, 0.25, 1.0, 0.25, 0.125, 1.0)),
        ("neurons", (0.25, 0.25, 0.25, 1.0, 0.25)),
        ("weights", (0.125, 1.0)),
    ],
)
def test_shares_by_hand(what: str, shares: tuple[float, ...]) -> None:
    assert parameters(what=what).read(robot(BRAIN)) == pytest.approx(shares)


def test_new_values_by_hand() -> None:
    own = parameters(weight_limits=(-2.0, 2.0))
    shares = (1.0, 0.0, 0.5, 0.5, 0.0, 0.25, 0.75)
    found = own.written(robot(BRAIN), shares).brain
    assert [each.parameters for each in found.neurons] == [
        (), (1.0, 0.0), (5.0, 1.57, 0.0)
    ]  # fmt: skip
    assert [each.weight for each in found.connections] == [-1.0, 1.0]
    only = parameters(what="weights").written(robot(BRAIN), (0.0, 0.5)).brain
    assert only.neurons == BRAIN.neurons
    assert [each.weight for each in only.connections] == [0.0, 0.5]


@pytest.mark.parametrize("brain", ["network", "cpg", "modular"])
def test_any_robot_keeps_what_it_learns_in_its_genome(brain: str) -> None:
    experiment = Experiment(name="test", brain=BrainSection(type=brain), space=ROOM)
    own = parameters(experiment.brain)
    encoding, types = encoding_of(experiment), body_space(experiment.space)
    rng = np.random.default_rng(1)
    dormant = 0
    parents = [candidate(experiment, BirthId(0, number)) for number in range(6)]
    population = [each.individual(0) for each in parents]
    for number in range(6, 18):
        found = candidate(experiment, BirthId(0, number), population)
        born = found.robot.brain
        count = len(own.read(found.robot))
        shares = tuple(rng.random(count).tolist())
        learnt = own.written(found.robot, shares)
        assert own.read(learnt) == pytest.approx(shares, abs=1e-12)
        encoding.check(learnt)
        new = encoding.with_brain(found.genome, learnt)
        assert encoding.robot_of(new.genome) == new.robot == learnt
        # What the robot does not have stays.
        old = with_brain(decode_genome(new.genome), found.robot, types)
        assert encode_genome(old) == found.genome
        dormant += new.connections - len(born.connections)
    # Networks have connections that lead nowhere after crossover; cpg removes them.
    assert (dormant > 0) == (brain == "network")


def test_a_range_of_width_zero_is_not_learnt() -> None:
    one_hz = {"lowest_hz": 1.0, "highest_hz": 1.0}
    own = parameters(BrainSection(type="cpg", parameters=one_hz))
    neuron = Neuron("output", "PhaseOscillator", 1, (1.0, 0.25, 0.5, 0.75))
    swinging = robot(Brain((neuron,)))
    assert own.read(swinging) == (0.25, 0.5, 0.75)
    (found,) = own.written(swinging, (0.0, 1.0, 0.0)).brain.neurons
    assert found.parameters == (1.0, 0.0, 1.0, 0.0)


def test_a_sample_has_the_parameters_in_common_by_hand() -> None:
    """The core and one hinge have a common origin; the type of a neuron differs."""
    neurons = (
        Neuron("output", "Sigmoid", 1, (0.0, 0.5)),
        Neuron("output", "Simple", 2, (1.0, 1.0)),
        Neuron("hidden", "Simple", 0, (-1.0, 0.0)),
    )
    edges = (Connection(0, 1, 0.1), Connection(2, 1, 0.2), Connection(2, 2, 0.3))
    child = robot(Brain(neurons, edges), 1, 2, 3)
    others = (
        Neuron("output", "Sigmoid", 1, (0.5, 0.25)),
        Neuron("output", "Sigmoid", 2, (-0.5, 0.75)),
        Neuron("hidden", "Simple", 0, (0.5, 1.0)),
    )
    edges = (Connection(0, 1, 0.6), Connection(2, 1, 0.7), Connection(2, 0, 0.8))
    parent = robot(Brain(others, edges), 1, 3, 2)
    own = parameters()
    # Of child: hinge 2 (bias, gain), hinge 3, hidden, three weights.
    assert own.read(child) == pytest.approx(
        (0.5, 0.5, 1.0, 1.0, 0.0, 0.0, 0.1, 0.2, 0.3)
    )
    # Its hinge 2 is the parent's third part; its hinge 3 has another type of neuron.
    assert own.sample(child, parent) == pytest.approx(
        (0.25, 0.75, 1.0, 1.0, 0.75, 1.0, 0.1, 0.2, 0.3)
    )
    weights = parameters(what="weights")
    simple = robot(Brain(neurons, edges), 1, 2, 3)
    assert weights.sample(child, simple) == pytest.approx((0.6, 0.7, 0.3))
    # Strangers, and parts without origin, have nothing in common.
    assert own.sample(child, robot(Brain(others, edges), 7, 8, 9)) is None
    assert own.sample(child, robot(Brain(neurons, edges), 1, 0, 3)) is None


def test_modules_share_what_is_learnt_by_hand() -> None:
    """Two hinges in a row: one bias and one weight each way for both."""

    def modules(biases: tuple[float, float], weights: tuple[float, ...]) -> Robot:
        neurons = tuple(
            Neuron("output", "ModuleNeuron", at, (bias,))
            for at, bias in zip((1, 2), biases, strict=True)
        )
        ends = ((0, 0), (1, 1), (0, 1), (1, 0))
        edges = (Connection(*end, w) for end, w in zip(ends, weights, strict=True))
        return robot(Brain(neurons, tuple(edges)), 1, 2, 3)

    own = parameters(MODULAR)
    first = modules((0.5, 0.5), (1.0, 1.0, -2.0, 0.0))
    # Bias from -1 to 1; weights from -2 to 2: own, of the parent, of the child.
    assert own.read(first) == (0.75, 0.75, 0.0, 0.5)
    assert own.written(first, (0.5, 0.25, 0.75, 1.0)) == modules(
        (0.0, 0.0), (-1.0, -1.0, 1.0, 2.0)
    )
    # Any body: a robot of other origin with one hinge.
    neuron = Neuron("output", "ModuleNeuron", 1, (-0.5,))
    other = robot(Brain((neuron,), (Connection(0, 0, 2.0),)), 8, 9)
    assert own.sample(first, other) == (0.25, 1.0, 0.0, 0.5)
