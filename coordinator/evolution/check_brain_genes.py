"""Check of the half of a brain type that makes genes, before the first birth."""

from typing import cast

from msgspec.structs import replace

from coordinator.evolution.brains import brain_genes
from coordinator.evolution.check_encoding import check_encoding
from schema.errors import shown
from schema.experiment.document import EncodingSection, Experiment
from schema.plugins.contract import broken
from schema.robot.brain import NeuronKinds
from schema.robot.genome import ConnectionGene, Genome, NeuronGene, Node, walk


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
