"""Who is alive when: the population table as arrays, individuals as births rows."""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pyarrow as pa

from analysis.measures.trees import Integers

Numbers = npt.NDArray[np.float64]
Truths = npt.NDArray[np.bool_]

_BITS, _PLACE = 38, 50
"""Where, in a number that names somebody, the island of birth and the island stand."""


@dataclass(frozen=True, slots=True)
class PopulationTable:
    """The recorded populations of a run, by island and births.

    Attributes:
        islands: (G,) whose population it is.
        births: (G,) born there by then.
        starts: (G + 1,) where each population starts in what follows.
        members: (N,) row of each living individual in the births table.
        fitness: (N,) what counts of it [m/s]; NaN where it is not judged.
        lacking: populations that were left out, for want of a member's birth.
    """

    islands: Integers
    births: Integers
    starts: Integers
    members: Integers
    fitness: Numbers
    lacking: int

    @property
    def sizes(self) -> Integers:
        """How many are alive in each population, (G,)."""
        return np.diff(self.starts)

    @property
    def group_of(self) -> Integers:
        """Number of the population that each row belongs to, (N,)."""
        return np.repeat(np.arange(len(self.births)), self.sizes)

    @property
    def is_judged(self) -> Truths:
        """Whose fitness counts, (N,)."""
        return ~np.isnan(self.fitness)

    @property
    def is_last(self) -> Truths:
        """Which populations are their island's last recorded, (G,)."""
        return np.append(self.islands[1:] != self.islands[:-1], True)[: len(self)]

    def __len__(self) -> int:
        return len(self.births)

    def mean(self, values: Numbers) -> Numbers:
        """Return the mean of each population, (G,); NaN where nobody has a value.

        Args:
            values: (N,) of its members; NaN is left out.
        """
        is_known = ~np.isnan(values)
        total = self.sum(np.where(is_known, values, 0.0))
        count = self.sum(is_known.astype(np.float64))
        unknown = np.full(len(self), np.nan)
        found: Numbers = np.divide(total, count, out=unknown, where=count > 0)
        return found

    def sum(self, values: Numbers) -> Numbers:
        """Return the sum of each population, (G,), of (N,) values."""
        total = np.bincount(self.group_of, values, minlength=len(self))
        return total.astype(np.float64)


def names(
    table: pa.Table, island: str = "birth_island", birth: str = "birth"
) -> Integers:
    """Return one number per row that names an individual, (N,).

    Args:
        table: with a column of islands and one of births.
        island: name of the column of the island of birth, below 4096.
        birth: name of the column of the number of birth there.
    """
    islands = np.asarray(table[island], np.int64)
    return islands << _BITS | np.asarray(table[birth], np.int64)


def stays(table: pa.Table) -> Integers:
    """Return one number per row that names an individual on one island, (N,).

    Args:
        table: ``island`` (where it lives, below 4096), ``birth_island``, ``birth``.
    """
    return np.asarray(table["island"], np.int64) << _PLACE | names(table)


def unnamed(stays: Integers) -> dict[str, pa.Array]:
    """Return the columns that ``stays`` were made of: where, and who."""
    return {
        "island": pa.array(stays >> _PLACE, pa.int32()),
        "birth_island": pa.array(
            stays >> _BITS & 2 ** (_PLACE - _BITS) - 1, pa.int32()
        ),
        "birth": pa.array(stays & 2**_BITS - 1, pa.int64()),
    }


def rows_of(wanted: Integers, births: pa.Table) -> Integers:
    """Return the births rows of named individuals, (N,); -1 where there is none.

    Args:
        wanted: (N,) as ``names`` returns them.
        births: births table of a run.
    """
    known = names(births, "island", "birth")
    if not len(known):
        return np.full(len(wanted), -1, np.int64)
    order = np.argsort(known, kind="stable")
    place = np.minimum(np.searchsorted(known, wanted, sorter=order), len(known) - 1)
    found: Integers = np.where(known[order[place]] == wanted, order[place], -1)
    return found


def population_table(population: pa.Table, births: pa.Table) -> PopulationTable:
    """Return who is alive when.

    A population with a member that the births table lacks is left out: a killed run
    may have recorded one and not the other.

    Args:
        population: of one run: ``island``, ``births``, ``birth_island`` and ``birth``
            (the individual's name), ``fitness``, ``is_online``. Without a fitness is
            off-line who failed, and counts 0 as in selection; on-line it is who is
            not mature yet, and does not count.
        births: of the same run: ``island``, ``birth``.
    """
    islands = np.asarray(population["island"], np.int64)
    numbers = np.asarray(population["births"], np.int64)
    fitness = np.asarray(population["fitness"].to_numpy(), np.float64)
    is_failed = np.isnan(fitness) & ~np.asarray(population["is_online"], np.bool_)
    fitness = np.where(is_failed, 0.0, fitness)
    members = rows_of(names(population), births)
    order = np.lexsort((numbers, islands))
    islands, numbers, members = islands[order], numbers[order], members[order]
    is_first = np.ones(len(order), np.bool_)
    is_first[1:] = (islands[1:] != islands[:-1]) | (numbers[1:] != numbers[:-1])
    group = np.cumsum(is_first) - 1
    lacking = np.unique(group[members < 0])
    kept = ~np.isin(group, lacking)
    islands, numbers, members = islands[kept], numbers[kept], members[kept]
    firsts = np.flatnonzero(is_first[kept])
    return PopulationTable(
        islands[firsts],
        numbers[firsts],
        np.append(firsts, len(members)),
        members,
        fitness[order][kept],
        len(lacking),
    )
