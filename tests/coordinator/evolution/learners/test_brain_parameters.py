"""Parameters of a brain as shares of their ranges, and back into genomes."""

from dataclasses import replace

import numpy as np
import pytest

from coordinator.evolution.encodings import encoding_of
from coordinator.evolution.learners.brain_parameters import BrainParameters
from schema.experiment.brains import neuron_kinds
from schema.experiment.document import BrainSection, Experiment, body_space
from schema.experiment.learning import Learning
from schema.robot.brain import Brain, Connection, Neuron
from schema.robot.ids import BirthId
from schema.robot.inverse_development import with_brain
from schema.robot.robot import Robot
from schema.wire.genome_bytes import encode_genome
from schema.wire.protobuf import decode_genome
from tests.coordinator.breeding import candidate

EXPERIMENT = Experiment(name="test")
KINDS = neuron_kinds(EXPERIMENT.brain, EXPERIMENT.space)
BRAIN = Brain(
    (
        Neuron("input", "Input", 0),
        Neuron("output", "Sigmoid", 1, (-0.5, 0.25)),
        Neuron("hidden", "Oscillator", 0, (2.5, 3.14, 0.5)),
    ),
    (Connection(0, 1, 0.125), Connection(2, 1, 1.5)),
)
"""Bias from -1 to 1, period to 10, phase to 3.14, amplitude to 2; one odd weight."""


@pytest.mark.parametrize(
    ("what", "shares"),
    [
        ("all", (0.25, 0.25, 0.25, 1.0, 0.25, 0.125, 1.0)),
        ("neurons", (0.25, 0.25, 0.25, 1.0, 0.25)),
        ("weights", (0.125, 1.0)),
    ],
)
def test_shares_by_hand(what: str, shares: tuple[float, ...]) -> None:
    own = BrainParameters(Learning(what=what), KINDS)  # type: ignore[arg-type]
    assert own.read(BRAIN) == pytest.approx(shares)


def test_new_values_by_hand() -> None:
    own = BrainParameters(Learning(weight_limits=(-2.0, 2.0)), KINDS)
    found = own.written(BRAIN, (1.0, 0.0, 0.5, 0.5, 0.0, 0.25, 0.75))
    assert [each.parameters for each in found.neurons] == [
        (), (1.0, 0.0), (5.0, 1.57, 0.0)
    ]  # fmt: skip
    assert [each.weight for each in found.connections] == [-1.0, 1.0]
    only = BrainParameters(Learning(what="weights"), KINDS).written(BRAIN, (0.0, 0.5))
    assert only.neurons == BRAIN.neurons
    assert [each.weight for each in only.connections] == [0.0, 0.5]


@pytest.mark.parametrize("brain", ["network", "cpg"])
def test_any_robot_keeps_what_it_learns_in_its_genome(brain: str) -> None:
    experiment = Experiment(name="test", brain=BrainSection(type=brain))
    kinds = neuron_kinds(experiment.brain, experiment.space)
    own = BrainParameters(Learning(), kinds)
    encoding, types = encoding_of(experiment), body_space(experiment.space)
    rng = np.random.default_rng(1)
    dormant = 0
    parents = [candidate(experiment, BirthId(0, number)) for number in range(6)]
    population = [each.individual(0) for each in parents]
    for number in range(6, 18):
        found = candidate(experiment, BirthId(0, number), population)
        born = found.robot.brain
        assert own.written(born, own.read(born)).neurons != ()
        shares = tuple(rng.random(len(own.read(born))).tolist())
        learnt = Robot(found.robot.parts, own.written(born, shares))
        assert own.read(learnt.brain) == pytest.approx(shares, abs=1e-12)
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
    fixed = [replace(each, low=0.5, high=0.5) for each in KINDS["Sigmoid"]]
    kinds = {"Sigmoid": tuple(fixed)}
    own = BrainParameters(Learning(what="neurons"), kinds)
    assert own.read(Brain(BRAIN.neurons[:2])) == ()
    assert own.written(Brain(BRAIN.neurons[:2]), ()) == Brain(BRAIN.neurons[:2])
