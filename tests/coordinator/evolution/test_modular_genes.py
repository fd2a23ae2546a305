"""Genes of modules with shared weights: what fits any body, and what varies."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from msgspec.structs import replace

from coordinator.evolution.brains import brain_genes, brain_rules
from coordinator.evolution.generation import generate
from coordinator.evolution.mutable_genome import preorder, to_genome, to_mutable
from coordinator.evolution.revolve_angle import RevolveAngle
from schema.experiment.brains import neuron_kinds
from schema.experiment.document import (
    BrainSection,
    Experiment,
    Space,
    Variation,
    body_space,
)
from schema.robot.genome import Genome, develop
from schema.robot.ids import BirthId
from schema.robot.origins import roles_of
from schema.robot.robot import Robot, check_robot
from tests.coordinator.genomes import draws, node

MODULAR = Experiment(
    name="test", brain=BrainSection(type="modular"), space=Space(max_hidden=60)
)
TYPES = body_space(MODULAR.space)


def grown(*parts: tuple[int, Genome], seed: int = 0) -> Genome:
    branches = preorder(to_mutable(node("Core", *parts), TYPES))
    brain_genes(MODULAR).grow(draws(seed), branches, branches, brain_rules(MODULAR))
    return to_genome(branches)


def shared(robot: Robot) -> dict[object, float]:
    """Return all shared numbers; fail if two modules differ in one."""
    places, roles = roles_of(robot)
    numbers: dict[object, set[float]] = {}
    for place, neuron in zip(places, robot.brain.neurons, strict=True):
        if neuron.layer != "input":
            assert neuron.kind == "ModuleNeuron"
            numbers.setdefault(place, set()).update(neuron.parameters)
    for role, edge in zip(roles, robot.brain.connections, strict=True):
        numbers.setdefault(role, set()).add(edge.weight)
    assert all(len(values) == 1 for values in numbers.values())
    return {name: next(iter(values)) for name, values in numbers.items()}


def test_modules_by_hand() -> None:
    """A core, a hinge with a motor, and a touch sensor behind it: two neurons each."""
    leg = node("ActiveHinge", (1, node("TouchSensor")), outputs=())
    robot = develop(
        grown((2, replace(leg, outputs=node("ActiveHinge").outputs))), TYPES
    )
    check_robot(robot, TYPES, neuron_kinds(MODULAR.brain, MODULAR.space))
    parts = [(each.layer, each.part) for each in robot.brain.neurons]
    assert parts == [
        *[("input", 0)] * 6, *[("input", 2)] * 2, ("output", 1),
        ("hidden", 0), ("hidden", 0), ("hidden", 1), ("hidden", 2), ("hidden", 2),
    ]  # fmt: skip
    owners = [part for _, part in parts]
    found = sorted(
        (owners[e.source], owners[e.target]) for e in robot.brain.connections
    )
    assert found == sorted(
        [(0, 0)] * (12 + 4) + [(1, 1)] * 4 + [(2, 2)] * (4 + 4)
        + [(0, 1), (1, 0), (1, 2), (2, 1)] * 4
    )  # fmt: skip
    numbers = shared(robot)
    # Biases; sensors of the core and of touch; own, of the parent, of the child.
    assert len(numbers) == 2 + 12 + 4 + 3 * 4
    ends = [(owners[e.source], owners[e.target]) for e in robot.brain.connections]
    _, roles = roles_of(robot)
    named = {role[1]: end for role, end in zip(roles, ends, strict=True)}
    assert {key: named[key] for key in ("own", "parent", "child")} == {
        "own": (2, 2), "parent": (1, 2), "child": (2, 1),
    }  # fmt: skip
    assert -2.0 <= min(numbers.values()) < 0.0 < max(numbers.values()) <= 2.0


def test_each_number_of_a_child_is_of_one_parent_or_near_it() -> None:
    first, second = (
        grown((0, node("ActiveHinge", (1, node("ActiveHinge")))), seed=seed)
        for seed in (1, 2)
    )
    still = {name: 0.0 for name in Variation.__struct_fields__ if name[:2] == "p_"}

    def child(epsilon: float, seed: int) -> dict[object, float]:
        """Return the shared numbers of a child; none if it would be too small."""
        variation = Variation(**{**still, "brain_epsilon": epsilon})
        encoding = RevolveAngle(replace(MODULAR, variation=variation), TYPES, None)
        rng = np.random.default_rng(seed)
        made = encoding.mate(first, second, rng, BirthId(0, 9))
        return shared(develop(made, TYPES)) if made else {}

    one, other = (shared(develop(each, TYPES)) for each in (first, second))
    taken = [0, 0]
    for seed in range(40):
        for name, value in child(0.0, seed).items():
            assert value in {one[name], other[name]}
            # The core's sensors are the first parent's alone.
            if not (isinstance(name, tuple) and name[0] == "input"):
                taken[value == other[name]] += 1
    assert 0.35 < taken[1] / sum(taken) < 0.55
    varied = next(filter(None, (child(0.05, seed) for seed in range(40))))
    for name, value in varied.items():
        assert value not in {one[name], other[name]}
        # A twentieth of the way to a random number in a range of width 4 or 2.
        assert min(abs(value - one[name]), abs(value - other[name])) <= 0.2


@given(st.integers(0, 2**32 - 1))
def test_children_have_one_module_of_the_same_numbers_in_each_part(seed: int) -> None:
    pair = [generate(np.random.default_rng((seed, n)), MODULAR) for n in (0, 1)]
    encoding = RevolveAngle(MODULAR, TYPES, None)
    child = encoding.mate(pair[0], pair[1], np.random.default_rng(seed), BirthId(0, 9))
    for genome in [*pair, *([child] if child else [])]:
        robot = develop(genome, TYPES)
        check_robot(robot, TYPES, neuron_kinds(MODULAR.brain, MODULAR.space))
        assert shared(robot).keys() >= {0, 1, ("input", "Core", 5, 1)}
        states = [each.part for each in robot.brain.neurons if each.layer != "input"]
        assert sorted(states) == sorted(2 * [*range(len(robot.parts))])
        links = 2 * (len(robot.parts) - 1) + len(robot.parts)
        inputs = robot.brain.count("input")
        assert len(robot.brain.connections) == 4 * links + 2 * inputs
        made = sum(len(b.connections) for b in preorder(to_mutable(genome, TYPES)))
        assert made == len(robot.brain.connections), "no gene is without effect"
