"""Genes of coupled oscillators: who is coupled, and what variation keeps."""

from collections import Counter

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from coordinator.evolution.brains import brain_genes, brain_rules
from coordinator.evolution.generation import generate
from coordinator.evolution.mutable_genome import preorder, to_genome, to_mutable
from coordinator.evolution.revolve_angle import RevolveAngle
from schema.experiment.brains import neuron_kinds
from schema.experiment.document import BrainSection, Experiment, Variation, body_space
from schema.robot.brain import Brain
from schema.robot.genome import Genome, NeuronGene, develop
from schema.robot.ids import BirthId
from schema.robot.robot import Robot, check_robot
from tests.coordinator.genomes import draws, node

CPG = Experiment(name="test", brain=BrainSection(type="cpg"))
TYPES = body_space(CPG.space)
GENE = NeuronGene("PhaseOscillator", (1.0, 0.0, 0.5, 0.5))
HINGE = node("ActiveHinge", outputs=(GENE,))


def coupled(genome: Genome, seed: int = 0) -> Genome:
    branches = preorder(to_mutable(genome, TYPES))
    brain_genes(CPG).grow(draws(seed), branches, branches, brain_rules(CPG))
    return to_genome(branches)


def couplings(brain: Brain) -> Counter[tuple[int, int]]:
    """Return the parts of source and target of each connection."""
    owners = [neuron.part for neuron in brain.neurons]
    return Counter((owners[e.source], owners[e.target]) for e in brain.connections)


def neighbours(robot: Robot) -> set[tuple[int, int]]:
    """Return pairs of parts with motors and none between them, from all paths."""
    motors = {n.part for n in robot.brain.neurons if n.layer == "output"}

    def line(part: int) -> list[int]:
        return [part] if part == 0 else [part, *line(robot.parts[part].parent)]

    found = set()
    for one in motors:
        for other in motors - {one}:
            up, down = line(one), line(other)
            shared = next(part for part in up if part in down)
            way = {*up[: up.index(shared) + 1], *down[: down.index(shared)]}
            if not (way - {one, other}) & motors:
                found.add((one, other))
    return found


def test_motors_without_a_motor_between_them_are_coupled_both_ways() -> None:
    """Two legs: core - hinge - brick - hinge, and core - brick - hinge."""
    first = node("ActiveHinge", (1, node("FixedBrick", (1, HINGE))), outputs=(GENE,))
    second = node("FixedBrick", (2, HINGE))
    genome = coupled(node("Core", (0, first), (1, second)))
    robot = develop(genome, TYPES)
    # Hinges are parts 1, 3 and 5.
    assert couplings(robot.brain) == Counter([(1, 3), (3, 1), (1, 5), (5, 1)])
    assert set(couplings(robot.brain)) == neighbours(robot)
    check_robot(robot, TYPES, neuron_kinds(CPG.brain, CPG.space))


def test_growth_adds_only_what_is_missing() -> None:
    genome = coupled(node("Core", (0, HINGE), (1, HINGE)))
    assert coupled(genome, seed=1) == genome


@given(st.integers(0, 2**32 - 1))
def test_children_couple_exactly_their_neighbours(seed: int) -> None:
    pair = [generate(np.random.default_rng((seed, n)), CPG) for n in (0, 1)]
    encoding = RevolveAngle(CPG, TYPES, None)
    child = encoding.mate(pair[0], pair[1], np.random.default_rng(seed), BirthId(0, 9))
    for genome in [*pair, *([child] if child else [])]:
        robot = develop(genome, TYPES)
        check_robot(robot, TYPES, neuron_kinds(CPG.brain, CPG.space))
        found = couplings(robot.brain)
        assert set(found) == neighbours(robot)
        assert set(found.values()) <= {1}
        assert robot.brain.count("hidden") == 0
        assert all(0.0 <= edge.weight <= 1.0 for edge in robot.brain.connections)
        made = sum(len(b.connections) for b in preorder(to_mutable(genome, TYPES)))
        assert made == len(robot.brain.connections), "no gene is without effect"


def test_oscillators_and_weights_move_by_their_share() -> None:
    still = Experiment(
        name="test", brain=CPG.brain, variation=Variation(brain_epsilon=0.25)
    )
    genome = coupled(node("Core", (0, HINGE), (1, HINGE)))
    before = [e.weight for e in develop(genome, TYPES).brain.connections]
    frequencies, shifts = [], []
    for seed in range(500):
        branches = preorder(to_mutable(genome, TYPES))
        made, rules, genes = draws(seed), brain_rules(still), brain_genes(still)
        genes.vary(made, branches, rules, genes.prune(made, branches, rules))
        brain = develop(to_genome(branches), TYPES).brain
        frequencies += [n.parameters[0] for n in brain.neurons if n.layer == "output"]
        shifts += [
            edge.weight - 0.75 * old
            for edge, old in zip(brain.connections, before, strict=True)
        ]
    # 0.75 x 1 + 0.25 x U(0.2, 2), and 0.75 x weight + 0.25 x U(0, 1).
    assert 0.8 <= min(frequencies) < 0.803
    assert 1.247 < max(frequencies) <= 1.25
    assert np.mean(frequencies) == pytest.approx(1.025, abs=0.02)
    assert 0.0 <= min(shifts) < 0.002
    assert 0.248 < max(shifts) <= 0.25 + 1e-12
