"""Ancestry of individuals, and the descendants of migrants."""

import math
from bisect import bisect_right
from graphlib import CycleError, TopologicalSorter

import numpy as np
import pyarrow as pa

from analysis.measures.population_table import (
    Numbers,
    PopulationTable,
    individual_ids,
    rows_of,
)
from schema.errors import RunFolderError
from schema.robot.trees import Integers
from schema.wire.updates import individual


def parents_of(births: pa.Table) -> list[list[int]]:
    """Return the births rows of each individual's parents.

    Args:
        births: births of one run: ``island``, ``birth``, ``parents``. In a run of
            several islands a parent's row may come after its child's.

    Raises:
        RunFolderError: a parent's birth is not recorded.
    """
    lists = births["parents"].combine_chunks()
    parents = lists.flatten()
    named = pa.table({name: parents.field(name) for name in ("island", "birth")})
    found = rows_of(individual_ids(named, "island"), births)
    ends = np.cumsum(lists.value_lengths().to_numpy())
    child = np.repeat(np.arange(len(lists)), np.diff(ends, prepend=0))
    orphans = child[found < 0]
    if len(orphans):
        raise RunFolderError(
            f"births: row {orphans[0]} has a parent whose birth is not recorded"
        )
    return [part.tolist() for part in np.split(found, ends[:-1])] if len(ends) else []


def parents_first(parents: list[list[int]]) -> list[int]:
    """Return all births rows, sorted so that parents come before their children.

    Raises:
        RunFolderError: an individual is its own ancestor.
    """
    try:
        return list(TopologicalSorter(dict(enumerate(parents))).static_order())
    except CycleError as error:
        row = min(error.args[1])
        raise RunFolderError(f"births: row {row} descends from itself") from None


def ancestors(parents: list[list[int]]) -> list[int]:
    """Return the ancestors of each individual, given ``parents_of``, as bits.

    Bit r of a number is set if births row r is an ancestor. An individual is not its
    own ancestor.
    """
    lines = [0] * len(parents)
    for row in parents_first(parents):
        for parent in parents[row]:
            lines[row] |= lines[parent] | 1 << parent
    return lines


def unique_ancestors(table: PopulationTable, lines: list[int]) -> Integers:
    """Return the number of different ancestors of each population, (G,).

    Only members whose fitness counts are considered; ``lines`` are their ``ancestors``.

    Source: Hupkes 2016, table 6.2 and figure 6.4.
    """
    unions = [0] * len(table)
    counted = table.is_judged
    pairs = zip(table.group_of[counted], table.members[counted], strict=True)
    for group, member in pairs:
        unions[group] |= lines[member]
    return np.array([union.bit_count() for union in unions], np.int64)


def phylogenetic_diversity(table: PopulationTable, parents: list[list[int]]) -> Numbers:
    """Return the branches of the tree of each population, (G,), of length 1 each.

    The tree has all living robots, their first parents, those of these, and so on up to
    the founders. A child begins as a copy of its first parent.

    Source: Faith 1992, "Conservation evaluation and phylogenetic diversity".
    """
    firsts = [each[:1] for each in parents]
    lines = ancestors(firsts)
    founders = sum(1 << row for row, above in enumerate(firsts) if not above)
    unions = [0] * len(table)
    pairs = zip(table.group_of.tolist(), table.members.tolist(), strict=True)
    for group, member in pairs:
        unions[group] |= lines[member] | 1 << member
    return np.array([(union & ~founders).bit_count() for union in unions], np.float64)


def foreign_share(
    table: PopulationTable, births: pa.Table, parents: list[list[int]]
) -> Numbers:
    """Return the share of each population with an origin on another island, (G,).

    An individual counts if it was born on another island or has an ancestor that was.
    NaN in a run of one island.

    Source: own; spread of the migrants' descendants.
    """
    if len(np.unique(table.islands)) <= 1:
        return np.full(len(table), np.nan)
    # Islands on which an individual and its ancestors were born, as bits.
    origins = [1 << home for home in births["island"].to_pylist()]
    for row in parents_first(parents):
        for parent in parents[row]:
            origins[row] |= origins[parent]
    here = table.islands[table.group_of].tolist()
    pairs = zip(table.members.tolist(), here, strict=True)
    is_foreign = [origins[member] != 1 << island for member, island in pairs]
    return table.mean(np.array(is_foreign, np.float64))


def phylogeny(births: pa.Table, population: pa.Table, first: int = 0) -> pa.Table:
    """Return the individuals of a run as a table of the ALife data standard.

    Parents come before their children. Times count the births on an island: an
    individual's number there, and the births at the first recorded population without
    it, the latest of all islands that it lived on; infinite while it lives.

    Args:
        births: of a run.
        population: of the run.
        first: id of the first individual.

    Raises:
        RunFolderError: a parent's birth is not recorded.

    Source: alife-data-standards, Phylogeny Standard.
    """
    keys = [np.asarray(births[name]) for name in ("birth", "island", "rank")]
    # The rank of a child is above those of its parents.
    births = births.take(np.lexsort(keys))
    named = (births["island"].to_pylist(), births["birth"].to_pylist())
    born = list(zip(*named, strict=True))
    ancestors = [[str(first + row) for row in rows] for rows in parents_of(births)]
    ends = _ends(born, population)
    return pa.table(
        {
            "id": pa.array(range(first, first + len(born)), pa.int64()),
            "ancestor_list": pa.array(
                [f"[{', '.join(each) or 'none'}]" for each in ancestors], pa.string()
            ),
            "origin_time": births["birth"],
            "destruction_time": pa.array([ends[each] for each in born], pa.float64()),
            **{name: births[name] for name in ("island", "rank", "sim_time_s")},
            "run_id": births["run_id"],
        }
    )


def _ends(
    born: list[tuple[int, int]], population: pa.Table
) -> dict[tuple[int, int], float]:
    """Return the time at which each individual was gone, infinite of the living."""
    islands = population.group_by("island").aggregate([("births", "distinct")])
    recorded: dict[int, list[float]] = {
        row["island"]: [*sorted(row["births_distinct"]), math.inf]
        for row in islands.to_pylist()
    }

    def after(island: int, births: int) -> float:
        times = recorded.get(island, [math.inf])
        return times[bisect_right(times, births)]

    ends: dict[tuple[int, int], float] = {}
    named = ["island", "birth_island", "birth"]
    for row in population.group_by(named).aggregate([("births", "max")]).to_pylist():
        member, end = individual(row), after(row["island"], row["births_max"])
        ends[member] = max(ends.get(member, end), end)
    # Children that were never in a population went with the first one after them.
    return {each: ends[each] if each in ends else after(*each) for each in born}
