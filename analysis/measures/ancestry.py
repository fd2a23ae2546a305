"""Who descends from whom."""

import numpy as np
import pyarrow as pa

from analysis.measures.population_table import (
    Numbers,
    PopulationTable,
    Truths,
    names,
    rows_of,
)
from analysis.measures.trees import Integers
from schema.errors import RunFolderError


def parents_of(births: pa.Table) -> list[list[int]]:
    """Return the births rows of each individual's parents.

    Args:
        births: of one run: ``island``, ``birth``, ``parents``. Of several islands a
            parent's row may stand behind its child's.

    Raises:
        RunFolderError: a parent whose birth is not recorded.
    """
    lists = births["parents"].combine_chunks()
    named = pa.table(
        {name: lists.flatten().field(name) for name in ("island", "birth")}
    )
    found = rows_of(names(named, "island", "birth"), births)
    ends = np.cumsum(lists.value_lengths().to_numpy())
    child = np.repeat(np.arange(len(lists)), np.diff(ends, prepend=0))
    orphans = child[found < 0]
    if len(orphans):
        raise RunFolderError(
            f"births: row {orphans[0]} has a parent whose birth is not recorded"
        )
    return [part.tolist() for part in np.split(found, ends[:-1])] if len(ends) else []


def parents_first(parents: list[list[int]]) -> list[int]:
    """Return all births rows in an order in which parents stand before children.

    Raises:
        RunFolderError: somebody who is an ancestor of itself.
    """
    children: list[list[int]] = [[] for _ in parents]
    waits_for = [len(couple) for couple in parents]
    for child, couple in enumerate(parents):
        for parent in couple:
            children[parent].append(child)
    order = [row for row, count in enumerate(waits_for) if not count]
    for row in order:  # grows while it is walked
        for child in children[row]:
            waits_for[child] -= 1
            if not waits_for[child]:
                order.append(child)
    if len(order) < len(parents):
        own = next(row for row, count in enumerate(waits_for) if count)
        raise RunFolderError(f"births: row {own} descends from itself")
    return order


def ancestors(parents: list[list[int]]) -> list[int]:
    """Return the ancestors of each individual, as bits of one number.

    Args:
        parents: as ``parents_of`` returns them.

    Returns:
        One number per individual: bit r is set if births row r is an ancestor. Nobody
        is an ancestor of itself.
    """
    found = [0] * len(parents)
    for row in parents_first(parents):
        for parent in parents[row]:
            found[row] |= found[parent] | 1 << parent
    return found


def unique_ancestors(population_table: PopulationTable, lines: list[int]) -> Integers:
    """Return how many different ancestors the judged of each population have, (G,).

    Args:
        population_table: of a run.
        lines: as ``ancestors`` returns them.

    Source: Hupkes 2016, table 6.2 and figure 6.4.
    """
    is_judged, members = (
        population_table.is_judged.tolist(),
        population_table.members.tolist(),
    )
    counts = []
    for start, end in zip(
        population_table.starts[:-1], population_table.starts[1:], strict=True
    ):
        union = 0
        for index in range(start, end):
            if is_judged[index]:
                union |= lines[members[index]]
        counts.append(union.bit_count())
    return np.array(counts, np.int64)


def origins(births: pa.Table, parents: list[list[int]]) -> list[int]:
    """Return on which islands an individual and its ancestors were born, as bits."""
    found = [1 << home for home in births["island"].to_pylist()]
    for row in parents_first(parents):
        for parent in parents[row]:
            found[row] |= found[parent]
    return found


def foreign_share(
    population_table: PopulationTable, births: pa.Table, parents: list[list[int]]
) -> Numbers:
    """Return the share of the living that is not of its island's own line, (G,).

    It was born elsewhere, or has an ancestor that was. NaN in a run of one island.

    Source: own; how far migrants' descendants spread.
    """
    if len(np.unique(population_table.islands)) <= 1:
        return np.full(len(population_table), np.nan)
    lines = origins(births, parents)
    here = population_table.islands[population_table.group_of].tolist()
    pairs = zip(population_table.members.tolist(), here, strict=True)
    is_foreign = [lines[member] != 1 << island for member, island in pairs]
    return population_table.mean(np.array(is_foreign, np.float64))


def descends(lines: list[int], ancestor: int) -> Truths:
    """Return who descends from an individual, (B,); not itself.

    Args:
        lines: as ``ancestors`` returns them.
        ancestor: its births row.
    """
    return np.array([line >> ancestor & 1 for line in lines], np.bool_)
