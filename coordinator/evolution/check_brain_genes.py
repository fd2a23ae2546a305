"""Check of the half of a brain type that makes genes, before the first birth."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from coordinator.evolution.brains import brain_genes
from coordinator.evolution.revolve_angle import RevolveAngle
from schema.errors import ExperimentError, InvalidRobot, shown
from schema.experiment.brains import widths
from schema.experiment.document import Experiment, body_space
from schema.plugins.contract import broken, repeated
from schema.robot.brain import NeuronKinds, check_widths
from schema.robot.genome import ConnectionGene, Genome, NeuronGene, Node, develop, walk
from schema.robot.ids import BirthId
from schema.robot.robot import check_robot

_FOUNDERS = 6
_CHILDREN = 20


def check_brain_genes(experiment: Experiment) -> None:
    """Raise unless a brain type makes valid robots, and equal ones of equal streams.

    A few random robots are made and mated, twice.

    Args:
        experiment: names the brain type.

    Raises:
        ExperimentError: genes that are no tuples of genes, a robot that breaks the
            rules or has too many hidden neurons, a connection that comes twice, a
            parameter outside its range, or robots that depend on more than `draws`.
        Exception: any error of its code.
    """
    kinds, space = brain_genes(experiment).neurons, body_space(experiment.space)

    def made() -> list[Genome]:
        genomes: list[Genome] = []
        for genome in _genomes(experiment):
            for node, _, _ in walk(genome):
                _check_types(node)
            try:
                robot = develop(genome, space)
                check_robot(robot, space, kinds)
                check_widths(robot.brain, widths(experiment.space))
            except InvalidRobot as error:
                raise ExperimentError(f"must make valid robots, got {error}") from None
            for node, _, _ in walk(genome):
                _check_genes(node, kinds, is_random=len(genomes) < _FOUNDERS)
            genomes.append(genome)
        return genomes

    repeated("robots", made)


def _check_types(node: Node) -> None:
    """Raise unless a node has genes of the right types."""
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
    ends = [(each.source, each.path, each.target) for each in node.connections]
    # Development ignores those that mutation may add.
    if is_random and len(set(ends)) < len(ends):
        raise broken(
            "connections", "differ in source, path or target", came=shown(ends)
        )
    for gene in (*node.outputs, *node.hidden):
        for known, value in zip(kinds[gene.kind], gene.parameters, strict=True):
            if not known.low <= value <= known.high:
                at = f"{known.name} of {gene.kind}"
                raise broken(at, f"be from {known.low} to {known.high}", value)


def _genomes(experiment: Experiment) -> Iterator[Genome]:
    """Yield random genomes and children of them."""
    encoding = RevolveAngle(experiment, body_space(experiment.space), None)
    genomes = []
    for seed in range(_FOUNDERS):
        rng = np.random.default_rng(seed)
        genomes.append(encoding.random(rng, BirthId(0, seed)))
        yield genomes[-1]
    for seed in range(_CHILDREN):
        for first, second in pairwise(genomes[-_FOUNDERS:]):
            rng = np.random.default_rng((seed, len(genomes)))
            birth = BirthId(0, len(genomes))
            if child := encoding.mate(first, second, rng, birth):
                genomes.append(child)
                yield child
                break
