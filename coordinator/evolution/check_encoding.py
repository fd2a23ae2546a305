"""Check of an encoding, and of the genes of a brain type, before the first birth."""

from collections.abc import Callable
from functools import partial
from typing import cast

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from coordinator.evolution.brains import brain_genes
from coordinator.evolution.encodings import IslandEncoding, encoding_of, outside_limits
from schema.errors import ExperimentError, InvalidRobot, shown
from schema.experiment.document import EncodingSection, Experiment, Space
from schema.plugins.contract import broken, repeated
from schema.robot.brain import NeuronKinds
from schema.robot.genome import ConnectionGene, Genome, NeuronGene, Node, walk
from schema.robot.ids import BirthId

_GENOMES = 24

Look = Callable[[object, bool], None]
"""Check of a genome, and whether it is a random one."""


def check_encoding(experiment: Experiment, look: Look = lambda *_: None) -> None:
    """Raise unless the encoding of an island keeps its contract.

    Random genomes and their children are made twice from equal random streams, written
    as bytes and read, and developed. No robot is evaluated. ``look`` raises for a
    genome that breaks another rule.

    Raises:
        UnknownPlugin: no such encoding.
        ExperimentError: another result from equal arguments, a robot that breaks a
            limit, bytes that do not give the genome back, changed parents, no child
            of any couple, or a method that raises.
    """
    case = _Case(encoding_of(experiment), experiment.space, look)
    try:
        genomes = [case.random(number) for number in range(_GENOMES)]
        children: list[object] = []
        for number in range(_GENOMES):
            # Children of children, too.
            couple = genomes[number], (children or genomes)[-1]
            if (child := case.child(couple, number)) is not None:
                children.append(child)
    except InvalidRobot as error:
        raise ExperimentError(f"must make robots within [space], got {error}") from None
    if not children:
        came = f"None of all {_GENOMES}"
        raise broken("", "make a child of some couple", came=came)


class _Case(Struct, frozen=True):
    """An encoding, and what its methods must return."""

    encoding: IslandEncoding
    space: Space
    look: Look

    def random(self, number: int) -> object:
        """Return a random genome, checked."""

        def make() -> object:
            rng = np.random.default_rng(number)
            return self.encoding.random(rng, BirthId(0, number))

        genome = self._made("random", make, is_random=True)
        if genome is None:
            raise broken("random", "return a genome")
        return genome

    def child(self, couple: tuple[object, object], number: int) -> object:
        """Return a child of two genomes, checked; None if there is none."""
        parents = [self.encoding.to_bytes(parent) for parent in couple]

        def make() -> object:
            birth = BirthId(0, _GENOMES + number)
            return self.encoding.mate(*couple, np.random.default_rng(number), birth)

        child = self._made("crossover and mutate", make, is_random=False)
        if parents != [self.encoding.to_bytes(parent) for parent in couple]:
            rule = "leave parents as they are"
            raise broken("crossover and mutate", rule, came="changed ones")
        return child

    def _made(
        self, what: str, make: Callable[[], object], *, is_random: bool
    ) -> object:
        """Return a genome, None if there is none; raise unless it is repeatable."""
        encoding = self.encoding
        genomes: list[object] = []

        def written() -> bytes | None:
            genomes.append(make())
            if genomes[-1] is None:
                return None
            self.look(genomes[-1], is_random)
            return encoding.to_bytes(genomes[-1])

        data = repeated(what, written)
        if data is None:
            return None
        read = encoding.from_bytes(data)
        if encoding.to_bytes(read) != data:
            raise broken("from_bytes", "give the genome back", came="another one")
        robot = repeated("develop", partial(encoding.develop, genomes[0]))
        if any(encoding.develop(equal) != robot for equal in (genomes[1], read)):
            rule = "make equal robots of equal genomes"
            raise broken("develop", rule, came="another one")
        # Of the thesis's encoding, robots are not checked at each birth.
        encoding.check(robot)
        if problem := outside_limits(robot, self.space, encoding.types):
            raise InvalidRobot(problem)
        return genomes[0]


def check_brain_genes(experiment: Experiment) -> None:
    """Raise unless a brain type makes valid robots, and equal ones of equal streams.

    It is part of the thesis's encoding, which is checked with it.

    Raises:
        ExperimentError: as of ``check_encoding``; genes that are no tuples of genes, a
            connection that comes twice, or a parameter outside its range.
        Exception: any error of its code.
    """
    kinds = brain_genes(experiment).neurons

    def look(genome: object, is_random: bool) -> None:  # noqa: FBT001 - a ``Look``
        for node, _, _ in walk(cast("Genome", genome)):
            _check_types(node)
            _check_genes(node, kinds, is_random=is_random)

    check_encoding(replace(experiment, encoding=EncodingSection()), look)


def _check_types(node: Node) -> None:
    for name, kind in (
        ("outputs", NeuronGene),
        ("hidden", NeuronGene),
        ("connections", ConnectionGene),
    ):
        for gene in getattr(node, name):
            if not isinstance(gene, kind):
                raise broken(name, f"be a tuple of {kind.__name__}", gene)
            if not isinstance(getattr(gene, "parameters", ()), tuple):
                raise broken(name, "have parameters that are a tuple", gene)


def _check_genes(node: Node, kinds: NeuronKinds, *, is_random: bool) -> None:
    """Raise for a connection that comes twice, or a parameter outside its range."""
    ends = [(edge.source, edge.path, edge.target) for edge in node.connections]
    # Development ignores those that mutation may add.
    if is_random and len(set(ends)) < len(ends):
        raise broken(
            "connections", "differ in source, path or target", came=shown(ends)
        )
    for gene in (*node.outputs, *node.hidden):
        known = kinds.get(gene.kind, ())
        if len(known) != len(gene.parameters):
            rule = f"be one of {', '.join(kinds)} with all of its parameters"
            raise broken("neurons", rule, gene)
        for parameter, value in zip(known, gene.parameters, strict=True):
            if not parameter.low <= value <= parameter.high:
                at = f"{parameter.name} of {gene.kind}"
                raise broken(at, f"be from {parameter.low} to {parameter.high}", value)
