"""Rules that rank by Pareto fronts: NSGA-II, and fitness against age of the body."""

from collections.abc import Sequence
from hashlib import blake2b
from typing import Annotated, Literal

import numpy as np
from msgspec import Meta, Struct
from msgspec.structs import replace

from coordinator.evolution.diversity.ranking import sound
from coordinator.evolution.members import Member
from schema.errors import ExperimentError, shown
from schema.experiment.document import Experiment
from schema.experiment.section import AtLeastOne
from schema.robot.ids import BirthId
from schema.robot.trace import Floats
from schema.robot.trees import Integers

_FITNESS = "fitness"


def front_numbers(values: Floats) -> Integers:
    """Return the number of the Pareto front of each row, from 0.

    Values are (N, M) of M objectives, all minimised.
    """
    is_less = np.any(values[:, None] < values, axis=2)
    dominates = is_less & ~is_less.T
    numbers = np.full(len(values), -1)
    while (left := numbers < 0).any():
        front = left & ~dominates[left].any(axis=0)
        numbers[front] = numbers.max() + 1
    return numbers


def crowding_distances(values: Floats) -> Floats:
    """Return the crowding distance of each row of one front, (N,).

    The sum, over objectives, of the distances between its neighbours, as shares of the
    range; infinite at the ends.

    Source: Deb et al. 2002, section III B.
    """
    total = np.zeros(len(values))
    for column in values.T:
        order = np.argsort(column, kind="stable")
        ordered = column[order]
        gaps = np.full(len(values), np.inf)
        gaps[1:-1] = (ordered[2:] - ordered[:-2]) / (np.ptp(ordered) or 1.0)
        total[order] += gaps
    return total


class Objectives(Struct, frozen=True, kw_only=True):
    """Parameters of ``nsga2``.

    Attributes:
        objectives: ``max`` or ``min`` by name, of ``fitness`` and measures; at least 2.
    """

    objectives: Annotated[dict[str, Literal["max", "min"]], Meta(min_length=2)]


class Nsga2:
    """Ranks by Pareto front, then by crowding distance (Deb et al. 2002, NSGA-II)."""

    Parameters = Objectives

    def __init__(self, parameters: Objectives, experiment: Experiment) -> None:
        known = (_FITNESS, *experiment.measures.labels)
        self._senses = parameters.objectives
        if not self._senses.keys() <= {*known}:
            rule = f"objectives: must be of {', '.join(known)}"
            raise ExperimentError(f"{rule}, got {shown([*self._senses])}")

    def ranks(self, population: Sequence[Member]) -> list[tuple[int, float]]:
        """Return front and crowding distance, negative, of each individual."""
        values = self._values(population)
        fronts = front_numbers(values)
        crowding = np.zeros(len(values))
        for number in set(fronts.tolist()):
            crowding[fronts == number] = crowding_distances(values[fronts == number])
        return list(zip(fronts.tolist(), (-crowding).tolist(), strict=True))

    def _values(self, population: Sequence[Member]) -> Floats:
        columns = []
        for at, sense in self._senses.items():
            column = [
                m.fitness if at == _FITNESS else m.measures[at] for m in population
            ]
            columns.append(np.array(column) * (-1.0 if sense == "max" else 1.0))
        return np.array(columns, np.float64).T

    def archive(self, population: Sequence[Member]) -> dict[str, Member]:
        """Return the first front."""
        some = sound(population)
        fronts = front_numbers(self._values(some)).tolist()
        front = [one for one, at in zip(some, fronts, strict=True) if at == 0]
        return {one.birth.name: one for one in front}


class AgeLayers(Struct, frozen=True, kw_only=True):
    """Parameters of ``age-layered``.

    Attributes:
        layer: births of one layer of ages, in which all bodies count as equally old.
    """

    layer: AtLeastOne = 15


class AgeLayered:
    """Ranks by Pareto fronts of age of the body and fitness, then by fitness.

    A child whose body has the structure of a parent's inherits its age; mutation
    changes some length or colour at each birth. An immigrant counts as old as the
    number of its birth says, and its children's bodies as new.

    Source: Schmidt and Lipson 2011 (age and fitness); Cheney et al. 2018 (of bodies).
    """

    Parameters = AgeLayers

    def __init__(self, parameters: AgeLayers, _experiment: Experiment) -> None:
        self._layer = parameters.layer
        self._bodies: dict[BirthId, tuple[bytes, int]] = {}

    def ranks(self, population: Sequence[Member]) -> list[tuple[int, float]]:
        """Return front and fitness, negative, of each individual."""
        newest = max((one.birth.number for one in population), default=0)
        layers = [(newest - self._body(one)[1]) // self._layer for one in population]
        fitness = [-one.fitness for one in population]
        fronts = front_numbers(np.array([layers, fitness], np.float64).T)
        return list(zip(fronts.tolist(), fitness, strict=True))

    def _body(self, one: Member) -> tuple[bytes, int]:
        """Return a digest of its structure, and the birth that it came with."""
        if one.birth in self._bodies:
            return self._bodies[one.birth]
        parts = [replace(part, parameters=(), gene=0) for part in one.robot.parts]
        structure = blake2b(repr(parts).encode(), digest_size=16).digest()
        bodies = [self._bodies[at] for at in one.parents if at in self._bodies]
        same = [birth for known, birth in bodies if known == structure]
        return structure, min(same, default=one.birth.number)

    def update(self, brood: Sequence[Member]) -> None:
        """Remember the bodies of a brood."""
        self._bodies.update({one.birth: self._body(one) for one in brood})
