"""Robots and genomes of the built-in body space, given or random."""

from dataclasses import dataclass, field
from typing import Any

from hypothesis import strategies as st
from hypothesis.strategies import DrawFn, SearchStrategy
from msgspec.structs import replace

from schema.parts import (
    BUILT_IN,
    BodySpace,
    Box,
    Joint,
    Matrix,
    Parameter,
    Shape,
    Slot,
    cylinder,
)
from schema.robot.brain import INPUT, NEURON_TYPES, Brain, Layer, Neuron
from schema.robot.genome import ConnectionGene, Genome, NeuronGene, Node, develop
from schema.robot.robot import ORIENTATIONS, Part, Robot

GREY = (0.5, 0.5, 0.5)
CORE = Part("Core", -1, -1, -1, 0, GREY)
ON_SIDE: Matrix = ((0.0, 0.0, 1.0), (0.0, 1.0, 0.0), (-1.0, 0.0, 0.0))
SLIDE = Shape(
    boxes=(
        Box("rail", (0.02, 0.02, 0.02), (0.01, 0.0, 0.0), 0.02),
        cylinder("rod", 0.005, 0.04, (0.04, 0.0, 0.0), 0.01, segment=1,
                 rotation=ON_SIDE),
    ),
    slots=(
        Slot((0.0, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),
        Slot((0.06, 0.0, 0.0), (1.0, 0.0, 0.0), (0.0, 0.0, 1.0), 1),
    ),
    joint=Joint((0.03, 0.0, 0.0), (1.0, 0.0, 0.0), 0.015, "prismatic"),
)  # fmt: skip


def robot_of(*parts: Part, space: BodySpace = BUILT_IN) -> Robot:
    """Return a core with parts, all inputs, and a simple output for each motor."""
    kinds = [space[part.kind] for part in (CORE, *parts)]
    inputs = [Neuron("input", INPUT, at) for at, kind in enumerate(kinds)
              for _ in range(kind.inputs)]  # fmt: skip
    outputs = [Neuron("output", "Simple", at, (0.0, 0.5))
               for at, kind in enumerate(kinds) if kind.outputs]  # fmt: skip
    return Robot((CORE, *parts), Brain((*inputs, *outputs)))


def node(kind: str, slot: int = 0, **rest: Any) -> Node:  # noqa: ANN401 - any field
    """Return a node with default parameters and simple outputs."""
    part_type = BUILT_IN[kind]
    outputs = (NeuronGene("Simple", (0.0, 0.5)),) * part_type.outputs
    parameters = tuple(p.default for p in part_type.parameters)
    values = {"orientation": 0, "parameters": parameters, "outputs": outputs, **rest}
    return Node(kind, -1 if part_type.is_root else slot, **values)


CHILD_TYPES = [kind for kind in BUILT_IN.values() if not kind.is_root]
FINITE = st.floats(allow_nan=False, allow_infinity=False)


@dataclass
class Draft:
    """Node of a genome under construction."""

    node: Node
    children: dict[int, "Draft"] = field(default_factory=dict)

    def free(self) -> list[int]:
        used = {self.node.slot, *self.children}
        return [s for s in range(BUILT_IN[self.node.kind].arity) if s not in used]

    def finished(self) -> Node:
        children = tuple(
            (slot, self.children[slot].finished()) for slot in sorted(self.children)
        )
        return replace(self.node, children=children)


def drawn(draw: DrawFn, parameters: tuple[Parameter, ...]) -> tuple[float, ...]:
    return tuple(draw(st.floats(item.low, item.high)) for item in parameters)


@st.composite
def neuron_genes(draw: DrawFn) -> NeuronGene:
    kind = draw(st.sampled_from(sorted(NEURON_TYPES)))
    return NeuronGene(kind, drawn(draw, NEURON_TYPES[kind]))


@st.composite
def connection_genes(draw: DrawFn) -> ConnectionGene:
    layers: tuple[Layer, ...] = ("input", "output", "hidden")
    ends = st.tuples(st.sampled_from(layers), st.integers(0, 2))
    path = tuple(draw(st.lists(st.integers(0, 3), max_size=3)))
    return ConnectionGene(draw(ends), path, draw(ends), draw(FINITE))


def brain_of(draw: DrawFn, node: Node) -> Node:
    outputs = BUILT_IN[node.kind].outputs
    genes = neuron_genes()
    return replace(
        node,
        outputs=tuple(draw(st.lists(genes, min_size=outputs, max_size=outputs))),
        hidden=tuple(draw(st.lists(genes, max_size=2))),
        connections=tuple(draw(st.lists(connection_genes(), max_size=3))),
    )


@st.composite
def random_genomes(draw: DrawFn) -> Genome:
    core = Node("Core", -1, 0, drawn(draw, BUILT_IN["Core"].parameters))
    drafts = [Draft(brain_of(draw, core))]
    for _ in range(draw(st.integers(0, 8))):
        places = [(draft, slot) for draft in drafts for slot in draft.free()]
        if not places:
            break
        parent, slot = draw(st.sampled_from(places))
        kind = draw(st.sampled_from(CHILD_TYPES))
        node = Node(
            kind.name,
            draw(st.integers(0, kind.arity - 1)),
            draw(st.sampled_from(ORIENTATIONS)),
            drawn(draw, kind.parameters),
            gene=draw(st.integers(0, 2**64 - 1)),
        )
        drafts.append(Draft(brain_of(draw, node)))
        parent.children[slot] = drafts[-1]
    return drafts[0].finished()


def random_robots() -> SearchStrategy[Robot]:
    """Return well-formed robots; some paths of their genomes lead nowhere."""
    return random_genomes().map(lambda genome: develop(genome, BUILT_IN))
