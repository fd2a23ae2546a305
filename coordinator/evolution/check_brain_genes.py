"""Check of the half of a brain type that makes genes, before the first birth."""

from collections.abc import Iterator
from itertools import pairwise

import numpy as np

from coordinator.evolution.brains import OwnGenes, brain_genes
from coordinator.evolution.revolve_angle import RevolveAngle
from schema.errors import ExperimentError, InvalidRobot, RevolveError, shown
from schema.experiment.brains import widths
from schema.experiment.document import Experiment, body_space
from schema.plugins.origin import raised_text
from schema.robot.brain import NeuronKinds, check_widths
from schema.robot.genome import Genome, develop, walk
from schema.robot.ids import BirthId
from schema.robot.robot import check_robot

_FOUNDERS = 6
_CHILDREN = 20


def check_brain_genes(experiment: Experiment, *, is_new: bool = False) -> None:
    """Raise unless a brain type makes valid robots, and equal ones of equal streams.

    A few random robots are made and mated, twice.

    Args:
        experiment: names the brain type.
        is_new: refuse also what runs that have begun may go on with.

    Raises:
        ExperimentError: the brain type raises, makes a robot that breaks the rules or
            has too many hidden neurons, or depends on more than its arguments; of new
            runs, a connection that comes twice, or a parameter outside its range.
    """
    genes = brain_genes(experiment)
    where = genes.where if isinstance(genes, OwnGenes) else experiment.brain.type
    place = f"brain.type: {where}"
    try:
        first: list[Genome] = []
        for genome in _genomes(experiment):
            robot = develop(genome, body_space(experiment.space))
            check_robot(robot, body_space(experiment.space), genes.neurons)
            check_widths(robot.brain, widths(experiment.space))
            if is_new:
                _check_genes(genome, genes.neurons, is_random=len(first) < _FOUNDERS)
            first.append(genome)
        second = list(_genomes(experiment))
    except InvalidRobot as error:
        raise ExperimentError(f"{place}: expected valid robots, got {error}") from None
    except RevolveError:
        raise
    except Exception as error:
        raise ExperimentError(
            f"{place}: expected outputs, grow, prune and vary to make genes, got "
            f"{raised_text(error, where)}"
        ) from error
    if first != second:
        raise ExperimentError(
            f"{place}: expected equal robots from equal random numbers, got different "
            "ones: draw from `draws` only and keep no state"
        )


def _check_genes(genome: Genome, kinds: NeuronKinds, *, is_random: bool) -> None:
    """Raise for a connection that comes twice, or a parameter outside its range."""
    for node, _, _ in walk(genome):
        ends = [(each.source, each.path, each.target) for each in node.connections]
        # Development ignores those that mutation may add.
        if is_random and len(set(ends)) < len(ends):
            raise InvalidRobot(f"one with a second connection among {shown(ends)}")
        for gene in (*node.outputs, *node.hidden):
            for known, value in zip(kinds[gene.kind], gene.parameters, strict=True):
                if not known.low <= value <= known.high:
                    what = f"{gene.kind} must have {known.name} from {known.low} to"
                    raise InvalidRobot(f"{what} {known.high}, got {value}")


def _genomes(experiment: Experiment) -> Iterator[Genome]:
    """Yield random genomes and children of them."""
    encoding = RevolveAngle(experiment, body_space(experiment.space), None)
    found = []
    for seed in range(_FOUNDERS):
        rng = np.random.default_rng(seed)
        found.append(encoding.random(rng, BirthId(0, seed)))
        yield found[-1]
    for seed in range(_CHILDREN):
        for first, second in pairwise(found[-_FOUNDERS:]):
            rng = np.random.default_rng((seed, len(found)))
            birth = BirthId(0, len(found))
            if child := encoding.mate(first, second, rng, birth):
                found.append(child)
                yield child
                break
