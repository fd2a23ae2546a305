"""Development of a small genome, connection by connection."""

import pytest
from hypothesis import given
from msgspec.structs import replace

from schema.parts import BUILT_IN
from schema.robot.brain import Layer
from schema.robot.genome import ConnectionGene, Genome, NeuronGene, develop, walk
from schema.robot.inverse_development import genome_of
from schema.robot.robot import Robot, check_robot
from tests.schema.robots import node, random_genomes, random_robots

End = tuple[Layer, int]
Edge = tuple[End, tuple[int, ...], End, float]
HIDDEN = NeuronGene("Sigmoid", (0.25, 0.75))

# Of the genome below: 6 inputs of the core, 2 of the touch sensor, then the
# outputs of both hinges, then the hidden neurons of core and second hinge.
IMU_X, IMU_WZ, LEFT, RIGHT, OUT_A, OUT_B, HIDDEN_CORE, HIDDEN_B = (0, *range(5, 12))


def gene(
    source: End, path: tuple[int, ...], target: End, weight: float
) -> ConnectionGene:
    return ConnectionGene(source, path, target, weight)


def limb(**connections: tuple[ConnectionGene, ...]) -> Genome:
    """Core: hinge A on slot 0 with a touch sensor; on slot 2 a brick, hinge B on it.

    The brick is attached by its slot 3; B is on its slot 1, by its own slot 1.
    """
    touch = node("TouchSensor", connections=connections.get("touch", ()))
    a = node(
        "ActiveHinge", children=((1, touch),), connections=connections.get("a", ())
    )
    b = node(
        "ActiveHinge", 1, hidden=(HIDDEN,), connections=connections.get("b", ()), gene=7
    )
    brick = node("FixedBrick", 3, children=((1, b),))
    return node(
        "Core",
        children=((0, a), (2, brick)),
        hidden=(HIDDEN,),
        connections=connections.get("core", ()),
    )


def edges(genome: Genome) -> list[tuple[int, int, float]]:
    connections = develop(genome, BUILT_IN).brain.connections
    return [(edge.source, edge.target, edge.weight) for edge in connections]


def test_parts_are_in_depth_first_order_by_slot() -> None:
    robot = develop(limb(), BUILT_IN)
    places = [(p.kind, p.parent, p.parent_slot, p.slot, p.gene) for p in robot.parts]
    assert places == [
        ("Core", -1, -1, -1, 0),
        ("ActiveHinge", 0, 0, 0, 0),
        ("TouchSensor", 1, 1, 0, 0),
        ("FixedBrick", 0, 2, 3, 0),
        ("ActiveHinge", 3, 1, 1, 7),
    ]
    visits = [(n.kind, parent, slot) for n, parent, slot in walk(limb())]
    assert visits == [(kind, parent, slot) for kind, parent, slot, *_ in places]


def test_neurons_are_sorted_by_layer_then_part() -> None:
    neurons = develop(limb(), BUILT_IN).brain.neurons
    layers = [(neuron.layer, neuron.part) for neuron in neurons]
    inputs = [("input", 0)] * 6 + [("input", 2)] * 2
    outputs, hidden = [("output", 1), ("output", 4)], [("hidden", 0), ("hidden", 4)]
    assert layers == [*inputs, *outputs, *hidden]
    assert neurons[HIDDEN_B].kind == "Sigmoid"
    assert neurons[HIDDEN_B].parameters == (0.25, 0.75)


@pytest.mark.parametrize(
    ("owner", "connection", "expected"),
    [
        # An empty path is the node itself, a loop included.
        ("core", (("input", 5), (), ("hidden", 0), 0.1), (IMU_WZ, HIDDEN_CORE, 0.1)),
        ("a", (("output", 0), (), ("output", 0), 0.2), (OUT_A, OUT_A, 0.2)),
        # Down one edge, down two.
        ("core", (("input", 0), (0,), ("output", 0), 0.3), (IMU_X, OUT_A, 0.3)),
        ("core", (("hidden", 0), (2, 1), ("hidden", 0), 1), (HIDDEN_CORE, HIDDEN_B, 1)),
        # Up, and up and down again: own slots lead to the parent.
        ("touch", (("input", 1), (0,), ("output", 0), 0.4), (RIGHT, OUT_A, 0.4)),
        ("touch", (("input", 0), (0, 0), ("hidden", 0), 0.5), (LEFT, HIDDEN_CORE, 0.5)),
        ("touch", (("input", 0), (0, 0, 2, 1), ("output", 0), 2.0), (LEFT, OUT_B, 2.0)),
        ("b", (("hidden", 0), (1, 3, 0), ("output", 0), -1.0), (HIDDEN_B, OUT_A, -1.0)),
        # There and back.
        ("b", (("output", 0), (1, 1), ("output", 0), 0.6), (OUT_B, OUT_B, 0.6)),
    ],
)
def test_connection_with_a_valid_path(
    owner: str, connection: Edge, expected: tuple[int, int, float]
) -> None:
    genome = limb(**{owner: (gene(*connection),)})
    assert edges(genome) == [expected]
    check_robot(develop(genome, BUILT_IN), BUILT_IN)


@pytest.mark.parametrize(
    ("owner", "connection"),
    [
        # A free slot, a slot that the type does not have, beyond a leaf.
        ("core", (("input", 0), (1,), ("output", 0), 0.1)),
        ("core", (("input", 0), (9,), ("output", 0), 0.1)),
        ("a", (("output", 0), (1, 3), ("output", 0), 0.1)),
        # It would come back, were it not broken in between.
        ("core", (("input", 0), (1, 0), ("output", 0), 0.1)),
        # No such neuron at the end, or at the beginning.
        ("core", (("input", 0), (2,), ("output", 0), 0.1)),
        ("core", (("input", 0), (0,), ("output", 1), 0.1)),
        ("core", (("input", 6), (0,), ("output", 0), 0.1)),
        ("core", (("hidden", 1), (0,), ("output", 0), 0.1)),
        # Nothing enters an input.
        ("a", (("output", 0), (1,), ("input", 0), 0.1)),
    ],
)
def test_connection_with_an_invalid_path_is_left_out(
    owner: str, connection: Edge
) -> None:
    kept = gene(("output", 0), (), ("output", 0), 0.5)
    genome = limb(**{owner: (gene(*connection),)})
    assert edges(genome) == []
    both = limb(**{owner: (gene(*connection),), "b": (kept,)})
    if owner != "b":
        assert edges(both) == [(OUT_B, OUT_B, 0.5)]


def test_first_connection_of_a_pair_of_neurons_is_kept() -> None:
    first = gene(("input", 0), (0,), ("output", 0), 0.1)
    detour = gene(("input", 0), (0, 0, 0), ("output", 0), 0.9)
    genome = limb(core=(first, detour))
    assert edges(genome) == [(IMU_X, OUT_A, 0.1)]


def test_reverse_connection_is_another_pair() -> None:
    up = gene(("output", 0), (1, 3, 0), ("output", 0), 0.1)
    down = gene(("output", 0), (0, 2, 1), ("output", 0), 0.2)
    genome = limb(a=(down,), b=(up,))
    assert edges(genome) == [(OUT_A, OUT_B, 0.2), (OUT_B, OUT_A, 0.1)]


def test_a_long_chain_develops() -> None:
    chain = node("FixedBrick")
    for _ in range(3000):
        chain = node("FixedBrick", children=((1, chain),))
    assert len(develop(node("Core", children=((0, chain),)), BUILT_IN).parts) == 3002


@given(genome=random_genomes())
def test_what_develops_is_well_formed(genome: Genome) -> None:
    robot = develop(genome, BUILT_IN)
    check_robot(robot, BUILT_IN)
    genes = [node for node, _, _ in walk(genome)]
    assert len(robot.brain.connections) <= sum(len(n.connections) for n in genes)
    weights = {edge.weight for node in genes for edge in node.connections}
    assert {edge.weight for edge in robot.brain.connections} <= weights


@given(genome=random_genomes())
def test_bodies_do_not_depend_on_brains(genome: Genome) -> None:
    bare = replace(genome, hidden=(), connections=())
    assert develop(bare, BUILT_IN).parts == develop(genome, BUILT_IN).parts


def unordered(robot: Robot) -> Robot:
    """Return a robot with sorted connections."""
    edges = sorted(robot.brain.connections, key=lambda edge: (edge.source, edge.target))
    return replace(robot, brain=replace(robot.brain, connections=tuple(edges)))


@given(robot=random_robots())
def test_development_inverts_genome_of(robot: Robot) -> None:
    again = develop(genome_of(robot), BUILT_IN)
    assert unordered(again) == unordered(robot)
    # From there on nothing changes any more, the order included.
    assert develop(genome_of(again), BUILT_IN) == again
