"""Measures of brains: distances of genomes by hand, cycles, and use of sensors."""

from typing import Any

import numpy as np
import pytest
from msgspec.structs import replace

from analysis.figures.courses import changes_over_births
from analysis.figures.forms import NothingToDraw
from analysis.measures.brains.controllers import Controller, of_genome, of_robot
from analysis.measures.brains.measures import change, recurrent, sensed
from analysis.measures.measures import brains
from analysis.measures.outputs import run_schema
from analysis.measures.run_tables import RunTables
from coordinator.islands.rows import body_rows
from schema.experiment.document import Space, body_space
from schema.robot.brain import INPUT, Brain, Connection, Layer, Neuron
from schema.robot.genome import ConnectionGene, NeuronGene, Node, develop
from schema.robot.robot import Part, Robot
from schema.wire.genome_bytes import encode_genome
from schema.wire.protobuf import encode_robot
from tests.analysis.drawn import layers
from tests.analysis.tables import births, population, run

GREY = (0.5, 0.5, 0.5)
SIGMOID = NeuronGene("Sigmoid", (0.0, 0.5))
LINEAR = NeuronGene("Simple", (0.5, 0.25))
CLOCK = NeuronGene("Oscillator", (5.0, 1.0, 1.0))


def link(
    source: tuple[Layer, int], target: tuple[Layer, int], weight: float, *path: int
) -> ConnectionGene:
    return ConnectionGene(source, path, target, weight)


def hinge(gene: int, neuron: NeuronGene, *edges: ConnectionGene, **rest: Any) -> Node:  # noqa: ANN401
    return Node(
        "ActiveHinge", 0, 0, GREY, gene, outputs=(neuron,), connections=edges, **rest
    )


def core(
    *children: tuple[int, Node],
    hidden: tuple[NeuronGene, ...] = (),
    edges: tuple[ConnectionGene, ...] = (),
) -> Node:
    return Node(
        "Core", -1, 0, GREY, 1, hidden=hidden, connections=edges, children=children
    )


PARENT = core(
    (0, hinge(2, LINEAR)),
    (2, hinge(3, CLOCK)),
    hidden=(SIGMOID,),
    edges=(
        link(("input", 0), ("hidden", 0), 0.5),
        link(("hidden", 0), ("output", 0), 0.25, 0),
    ),
)


HINGES = PARENT.children
EDGES = PARENT.connections
# Bias -1 to 1, gain 0 to 1; period 0 to 10, phase 0 to 3.14, amplitude 0 to 2.
OTHERS = (NeuronGene("Simple", (-0.5, 0.75)), NeuronGene("Oscillator", (2.5, 1.0, 2.0)))
VARIED = (1.0 / 2 + 0.5) / 2 + (2.5 / 10 + 0 + 1.0 / 2) / 3
GROWN = (
    link(("input", 0), ("hidden", 0), 0.5),
    link(("input", 5), ("hidden", 1), 0.5),
    link(("input", 5), ("output", 0), 0.5, 2),
)
HEAVY = (
    link(("input", 0), ("hidden", 0), 0.75),
    link(("hidden", 0), ("output", 0), 7.0, 0),
)
NOWHERE = (
    *EDGES,
    link(("input", 1), ("output", 0), 0.5, 1),
    link(("input", 1), ("hidden", 4), 0.5),
    link(("input", 0), ("hidden", 0), 0.9),
)
STILL = replace(PARENT, connections=())
LONE = core((0, hinge(2, LINEAR)))


@pytest.mark.parametrize(
    ("child", "parent", "expected"),
    [
        (PARENT, PARENT, (0.0, 0, 0)),
        # The body may change meanwhile.
        (replace(STILL, children=((1, HINGES[0][1]), HINGES[1])), STILL, (0.0, 0, 0)),
        # Parameters count by the width of their range, weights as they are.
        (replace(PARENT, children=((0, hinge(2, OTHERS[0])), (2, hinge(3, OTHERS[1])))),
         PARENT, (VARIED, 0, 0)),
        (replace(PARENT, hidden=(NeuronGene("Sigmoid", (90.0, 0.5)),)), PARENT,
         (1.0, 0, 0)),
        (replace(PARENT, connections=HEAVY), PARENT, (0.25 + 1.0, 0, 0)),
        # One hidden neuron and two connections are new, one connection is lost.
        (replace(PARENT, hidden=(SIGMOID, SIGMOID), connections=GROWN), PARENT,
         (0.0, 3, 1)),
        (replace(PARENT, children=HINGES[:1]), PARENT, (0.0, 0, 1)),
        # Another type is another neuron; its connections are others, too.
        (replace(PARENT, hidden=(LINEAR,)), PARENT, (0.0, 3, 3)),
        # So is the neuron of another part.
        (replace(PARENT, children=((0, hinge(9, LINEAR)), HINGES[1])), PARENT,
         (0.0, 2, 2)),
        # Copies of a part are told apart.
        (core((0, hinge(2, LINEAR)), (2, hinge(2, CLOCK)), (3, hinge(2, LINEAR))),
         LONE, (0.0, 2, 0)),
        # Connections that lead nowhere, or are there twice, are left out.
        (replace(PARENT, connections=NOWHERE), PARENT, (0.0, 0, 0)),
    ],
)  # fmt: skip
def test_distances_by_hand(
    child: Node, parent: Node, expected: tuple[float, int, int]
) -> None:
    varied, new, lost = expected
    assert change(of_genome(child), of_genome(parent)) == pytest.approx(expected)
    assert change(of_genome(parent), of_genome(child)) == pytest.approx(
        (varied, lost, new)
    )


def test_parts_without_identity_have_no_distance() -> None:
    stranger = replace(PARENT, gene=0)
    assert change(of_genome(stranger), of_genome(PARENT)) is None
    assert change(of_genome(PARENT), of_genome(stranger)) is None


def test_a_genome_and_its_robot_are_the_same() -> None:
    robot = develop(PARENT, body_space(Space()))
    found, wanted = of_robot(robot), of_genome(PARENT)
    assert (found.neurons, found.edges) == (wanted.neurons, wanted.edges)
    assert len(found.edges) == 2


def network(*edges: tuple[int, int, float], last: str = "Simple") -> Controller:
    """Return a brain: input 0, motors 1 and 2 (of a given type), hidden 3 and 4."""
    values = {"Simple": (0.0, 1.0), "Oscillator": (5.0, 0.0, 1.0)}
    neurons = (
        Neuron("input", INPUT, 0),
        Neuron("output", "Simple", 1, values["Simple"]),
        Neuron("output", last, 2, values[last]),
        Neuron("hidden", "Simple", 0, values["Simple"]),
        Neuron("hidden", "Simple", 0, values["Simple"]),
    )
    kinds = ("Core", "ActiveHinge", "ActiveHinge")
    parts = tuple(Part(k, i - 1, i, 0, 0, GREY, 1 + i) for i, k in enumerate(kinds))
    return of_robot(Robot(parts, Brain(neurons, tuple(Connection(*e) for e in edges))))


def test_share_of_weight_on_cycles() -> None:
    assert recurrent(network()) == 0.0
    assert recurrent(network((0, 3, 1.0), (3, 1, 1.0))) == 0.0
    assert recurrent(network((0, 1, 0.75), (1, 1, -0.25))) == 0.25
    # 3 -> 1 -> 4 -> 3 is a cycle; 4 -> 2 leaves it.
    cycle = ((3, 1, 0.5), (1, 4, 0.5), (4, 3, 0.5))
    assert recurrent(network(*cycle, (4, 2, 0.5))) == 0.75
    # The cycle 1 -> 2 -> 1 ends at an oscillator.
    ring = ((1, 2, 0.5), (2, 1, 0.5))
    assert recurrent(network(*ring)) == 1.0
    assert recurrent(network(*ring, last="Oscillator")) == 0.0


def test_share_of_motors_that_a_sensor_can_influence() -> None:
    assert sensed(network()) == 0.0
    assert sensed(network((0, 1, 0.1))) == 0.5
    assert sensed(network((0, 1, 0.0))) == 0.0
    assert sensed(network((0, 3, 1.0), (3, 4, 1.0), (4, 2, 1.0), (1, 1, 1.0))) == 0.5
    assert sensed(network((0, 1, 1.0), (1, 2, 1.0))) == 1.0
    assert sensed(network((0, 1, 1.0), (1, 2, 1.0), last="Oscillator")) == 0.5
    assert np.isnan(sensed(of_robot(Robot((Part("Core", -1, -1, -1, 0, GREY, 1),)))))


def test_table_of_a_run() -> None:
    types = body_space(Space())
    grown = replace(PARENT, hidden=(SIGMOID, SIGMOID))
    genomes = [PARENT, PARENT, grown]
    robots = [develop(each, types) for each in genomes]
    table = births(
        ((0, 0), []), ((0, 1), []), ((0, 2), [(0, 0), (0, 1)]),
        genome=[encode_genome(PARENT), b"", b""],
        robot=[None, encode_robot(robots[1]), encode_robot(robots[2])],
        body=[body_rows(each) for each in robots],
    )  # fmt: skip
    living = population((0, 3, {(0, 0): 0.1, (0, 2): 0.2}))
    found = brains(RunTables(run(births=table, population=living)))
    assert set(found.column_names) == set(run_schema("brains").names)
    assert found["brain_new"].to_pylist() == [None, None, 1.0]
    assert found["brain_lost"].to_pylist() == [None, None, 0.0]
    assert found["brain_change"].to_pylist() == [None, None, 1.0]
    assert found["body_change"].to_pylist() == [None, None, 0.0]
    # The hinge with the linear neuron listens, the other one has an oscillator.
    assert found["sensed"].to_pylist() == [0.5, 0.5, 0.5]
    assert found["recurrent"].to_pylist() == [0.0, 0.0, 0.0]

    named = found.append_column("experiment", [["a"] * 3])
    named = named.append_column("folder", [["runs/a"] * 3])
    # A line of one point is a dot.
    shown = layers(changes_over_births({"brains": named}))["geom_point"]
    panels = dict(zip(shown["panel"], shown["value"], strict=True))
    assert panels == {
        "body: tree edit distance [edits]": 0.0,
        "brain: distance [elements]": 1.0,
    }
    with pytest.raises(NothingToDraw, match="no robot has parents"):
        changes_over_births({"brains": named.slice(0, 2)})
