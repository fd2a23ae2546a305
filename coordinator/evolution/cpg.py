"""Genes of coupled oscillators, the brain type ``cpg``; see ``schema.robot.cpg``.

Each motor has an oscillator. Two motors are neighbours if they belong to one part, or
if the path between their parts passes no other part with a motor. Neighbours are
coupled in both directions; a coupling is a connection, its strength the weight.
"""

from collections.abc import Sequence
from typing import TypeVar

from msgspec.structs import replace

from schema.parts import Parameter, PartType
from schema.plugins.protocols import BrainRules, Branch, Draws, NeuronType
from schema.robot.brain import Layer, NeuronKinds
from schema.robot.cpg import PHASE_OSCILLATOR, CpgParameters, cpg_neurons
from schema.robot.genome import ConnectionGene, NeuronGene

B = TypeVar("B", bound=Branch)

Ends = tuple[tuple[Layer, int], tuple[int, ...], tuple[Layer, int]]
"""Source, path and target of a coupling."""

_WEIGHT = (Parameter("weight", 0.0, 1.0, 0.5),)


class CpgGenes:
    """An oscillator for each motor, coupled to those of neighbouring motors."""

    def __init__(
        self, parameters: CpgParameters, _: tuple[NeuronType, ...] = ()
    ) -> None:
        self.neurons: NeuronKinds = cpg_neurons(parameters)
        self._parameters = self.neurons[PHASE_OSCILLATOR]

    def outputs(self, draws: Draws, part: PartType) -> tuple[NeuronGene, ...]:
        """Return a random oscillator for each motor."""
        return tuple(
            NeuronGene(PHASE_OSCILLATOR, draws.values(self._parameters))
            for _ in range(part.outputs)
        )

    def grow(
        self,
        draws: Draws,
        new: Sequence[Branch],  # noqa: ARG002 - others have all their couplings
        branches: Sequence[Branch],
        rules: BrainRules,  # noqa: ARG002 - there are no hidden neurons
    ) -> None:
        """Couple all neighbours that are not coupled yet, with random weights."""
        _couple(draws, branches)

    def prune(
        self,
        draws: Draws,  # noqa: ARG002 - nothing is random here
        branches: Sequence[Branch],
        rules: BrainRules,  # noqa: ARG002
    ) -> None:
        """Remove couplings of motors that are no neighbours after crossover."""
        for branch in branches:
            wanted = _couplings(branch)
            branch.connections = tuple(
                gene for gene in branch.connections if _ends(gene) in wanted
            )

    def vary(
        self,
        draws: Draws,
        branches: Sequence[Branch],
        rules: BrainRules,
        pruned: None,  # noqa: ARG002 - nothing
    ) -> None:
        """Move oscillators and weights towards random values; couple neighbours."""
        for branch in branches:
            branch.outputs = tuple(
                NeuronGene(
                    gene.kind,
                    draws.nearby(self._parameters, gene.parameters, rules.epsilon),
                )
                for gene in branch.outputs
            )
            branch.connections = tuple(
                replace(
                    gene, weight=draws.nearby(_WEIGHT, (gene.weight,), rules.epsilon)[0]
                )
                for gene in branch.connections
            )
        _couple(draws, branches)


def _couple(draws: Draws, branches: Sequence[B]) -> None:
    """Add the couplings between neighbours that are missing, with random weights."""
    for branch in branches:
        coupled = [_ends(gene) for gene in branch.connections]
        branch.connections += tuple(
            ConnectionGene(*ends, draws.number())
            for ends in _couplings(branch)
            if ends not in coupled
        )


def _ends(gene: ConnectionGene) -> Ends:
    return gene.source, gene.path, gene.target


def _couplings(branch: B) -> list[Ends]:
    """Return source, path and target of all couplings from the motors of a part."""
    return [
        (source, branch.path_to(other), target)
        for source in branch.neurons("output")
        for other in _neighbours(branch)
        for target in other.neurons("output")
        if other is not branch or source != target
    ]


def _neighbours(branch: B) -> list[B]:
    """Return the parts whose motors are neighbours of a part's motors, itself first."""
    if not branch.outputs:
        return []
    found = [branch]
    # Places to look at, and where each was reached from.
    places: list[tuple[B, B]] = [(other, branch) for other in _joined(branch)]
    for place, origin in places:
        if place.outputs:
            found.append(place)
        else:
            places += [(each, place) for each in _joined(place) if each is not origin]
    return found


def _joined(branch: B) -> list[B]:
    """Return the parts that are attached to a part."""
    above = [branch.parent] if branch.parent is not None else []
    return [*above, *branch.children.values()]
