"""The population table as arrays, with individuals as rows of the births table."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from schema.robot.trees import Integers

Numbers = npt.NDArray[np.float64]
Booleans = npt.NDArray[np.bool_]

_BITS, _PLACE = 38, 50
"""Bits at which the island of birth and the island of residence start in an id."""


@dataclass(frozen=True, slots=True)
class PopulationTable:
    """The recorded populations of a run, by island and births.

    G is the number of populations, N that of their members together.

    Attributes:
        islands: (G,) island of each population.
        births: (G,) births on the island so far.
        starts: (G + 1,) index of each population's first member.
        members: (N,) row of each living individual in the births table.
        fitness: (N,) fitness [m/s]; NaN if it does not count.
        incomplete: number of populations skipped because a member's birth is missing.
    """

    islands: Integers
    births: Integers
    starts: Integers
    members: Integers
    fitness: Numbers
    incomplete: int

    @property
    def sizes(self) -> Integers:
        """Size of each population, (G,)."""
        return np.diff(self.starts)

    @property
    def living(self) -> list[slice]:
        """Where the members of each population are, G slices of N."""
        ends = self.starts.tolist()
        return [slice(*span) for span in pairwise(ends)]

    @property
    def group_of(self) -> Integers:
        """Index of each member's population, (N,)."""
        return np.repeat(np.arange(len(self.births)), self.sizes)

    @property
    def is_judged(self) -> Booleans:
        """Whether each member's fitness counts, (N,)."""
        return ~np.isnan(self.fitness)

    @property
    def is_last(self) -> Booleans:
        """Whether a population is the last one recorded of its island, (G,)."""
        return is_last_of_each(self.islands)

    def __len__(self) -> int:
        return len(self.births)

    def mean(self, values: Numbers) -> Numbers:
        """Return the means, (G,), of members' values, (N,); NaN is ignored."""
        is_known = ~np.isnan(values)
        return ratio(self.sum(np.where(is_known, values, 0.0)), self.sum(is_known))

    def sum(self, values: Numbers | Booleans) -> Numbers:
        """Return the sum of each population, (G,), of its members' values, (N,)."""
        total = np.bincount(self.group_of, values, minlength=len(self))
        return total.astype(np.float64)


def ratio(parts: Numbers, wholes: Numbers) -> Numbers:
    """Return parts by wholes, (G,); NaN where a whole is not above 0."""
    shares = np.full(len(parts), np.nan)
    np.divide(parts, wholes, out=shares, where=wholes > 0)
    return shares


def is_last_of_each(values: Integers) -> Booleans:
    """Return whether the next of some sorted values is another one, (N,)."""
    return np.append(values[1:] != values[:-1], True)[: len(values)]


def individual_ids(table: pa.Table, island: str = "birth_island") -> Integers:
    """Return the id of each row's individual as one number, (N,).

    ``island`` is the column of the island of birth, < 4096.
    """
    islands = np.asarray(table[island], np.int64)
    return islands << _BITS | np.asarray(table["birth"], np.int64)


def residence_ids(table: pa.Table) -> Integers:
    """Return the id of each row's individual and its ``island``, < 4096, (N,)."""
    return np.asarray(table["island"], np.int64) << _PLACE | individual_ids(table)


def last_there(table: pa.Table, times: Numbers | Integers) -> pa.Table:
    """Return the last row, by (N,) times, of each individual on each of its islands."""
    ids = residence_ids(table)
    order = np.lexsort((times, ids))
    return table.take(pa.array(order[is_last_of_each(ids[order])]))


def residence_islands(ids: Integers) -> Integers:
    """Return the ``island`` of ``residence_ids``, (N,)."""
    return ids >> _PLACE


def rows_of(wanted: Integers, births: pa.Table) -> Integers:
    """Return the births rows of ``individual_ids``, (N,); -1 if one is missing."""
    known = individual_ids(births, "island")
    if not len(known):
        return np.full(len(wanted), -1, np.int64)
    order = np.argsort(known, kind="stable")
    place = np.minimum(np.searchsorted(known, wanted, sorter=order), len(known) - 1)
    rows: Integers = np.where(known[order[place]] == wanted, order[place], -1)
    return rows


def population_table(population: pa.Table, births: pa.Table) -> PopulationTable:
    """Return the populations of a run.

    A population with a member that is not in the births table is skipped: a killed
    run may have recorded one and not the other.

    Args:
        population: ``island``, ``births``, ``birth_island`` and ``birth`` (id of the
            individual), ``fitness``, ``is_online``. Off-line a null fitness means that
            the evaluation failed, and counts as ``failed_fitness``, as in selection,
            unless all have failed; on-line it means that the robot is not mature, and
            does not count.
        births: births of the same run: ``island``, ``birth``.
    """
    islands = np.asarray(population["island"], np.int64)
    numbers = np.asarray(population["births"], np.int64)
    fitness = np.asarray(population["fitness"].to_numpy(), np.float64)
    is_failed = np.isnan(fitness) & ~np.asarray(population["is_online"], np.bool_)
    members = rows_of(individual_ids(population), births)
    order = np.lexsort((numbers, islands))
    islands, numbers, members = islands[order], numbers[order], members[order]
    is_first = np.ones(len(order), np.bool_)
    is_first[1:] = (islands[1:] != islands[:-1]) | (numbers[1:] != numbers[:-1])
    group = np.cumsum(is_first) - 1
    # ``failed_fitness`` of each population; none where all have failed.
    fitness, least = fitness[order], np.full(group.max(initial=-1) + 1, np.nan)
    np.fmin.at(least, group, fitness)
    least = np.minimum(least, 0.0)
    fitness = np.where(is_failed[order], least[group], fitness)
    incomplete = np.unique(group[members < 0])
    kept = ~np.isin(group, incomplete)
    islands, numbers, members = islands[kept], numbers[kept], members[kept]
    firsts = np.flatnonzero(is_first[kept])
    return PopulationTable(
        islands[firsts],
        numbers[firsts],
        np.append(firsts, len(members)),
        members,
        fitness[kept],
        len(incomplete),
    )
