"""Values of the births table that follow from a robot."""

from schema.parts import BodySpace
from schema.robot.genome import Node, walk
from schema.robot.robot import Robot
from schema.tables.columns import Row


def body_rows(robot: Robot) -> list[Row]:
    """Return the ``body`` of a births row: one dictionary per part, core first."""
    return [
        {
            "idx": index,
            "parent": part.parent,
            "parent_slot": part.parent_slot,
            "child_slot": part.slot,
            "kind": part.kind,
            "rot": part.orientation,
            "params": part.parameters,
            "gene": part.gene,
        }
        for index, part in enumerate(robot.parts)
    ]


def sizes(robot: Robot, genome: object, space: BodySpace) -> dict[str, int]:
    """Return the counts of a births row.

    Args:
        robot: the phenotype.
        genome: of the phenotype.
        space: its part types.

    Returns:
        ``parts``, ``joints`` (driven or not), ``motors`` (driven), ``extremities``
        (parts without children; a lone core counts 1), ``inputs``, ``outputs``,
        ``hidden``, and ``connections`` of a genome of ``revolve-angle``, including
        unresolved ones; of another genome's robot.

    Source: thesis section 6.3; the code of the original.
    """
    kinds = [space[part.kind] for part in robot.parts]
    brain = robot.brain
    connections = len(brain.connections)
    if isinstance(genome, Node):
        connections = sum(len(node.connections) for node, _, _ in walk(genome))
    # Includes -1, the parent of the core.
    parents = {part.parent for part in robot.parts}
    return {
        "parts": len(robot.parts),
        "joints": sum(
            kind.shape(part.parameters).joint is not None
            for kind, part in zip(kinds, robot.parts, strict=True)
        ),
        "motors": sum(kind.outputs for kind in kinds),
        "extremities": len(robot.parts) + 1 - len(parents),
        "inputs": brain.count("input"),
        "outputs": brain.count("output"),
        "hidden": brain.count("hidden"),
        "connections": connections,
    }
