"""Who descends from whom."""

import numpy as np
import pyarrow as pa

from analysis.census import Census, Numbers, Truths, names, rows_of
from analysis.trees import Integers
from schema.errors import RunFolderError


def parents_of(births: pa.Table) -> list[list[int]]:
    """Return the births rows of each individual's parents.

    Args:
        births: of one run, in the order of its records: ``island``, ``birth``,
            ``parents``.

    Raises:
        RunFolderError: a parent that is not born before its child.
    """
    lists = births["parents"].combine_chunks()
    named = pa.table(
        {name: lists.flatten().field(name) for name in ("island", "birth")}
    )
    found = rows_of(names(named, "island", "birth"), births)
    ends = np.cumsum(lists.value_lengths().to_numpy())
    child = np.repeat(np.arange(len(lists)), np.diff(ends, prepend=0))
    wrong = child[(found < 0) | (found >= child)]
    if len(wrong):
        raise RunFolderError(
            f"births: row {wrong[0]} has a parent that was not born before it"
        )
    return [part.tolist() for part in np.split(found, ends[:-1])] if len(ends) else []


def ancestors(parents: list[list[int]]) -> list[int]:
    """Return the ancestors of each individual, as bits of one number.

    Args:
        parents: as ``parents_of`` returns them.

    Returns:
        One number per individual: bit r is set if births row r is an ancestor. Nobody
        is an ancestor of itself.
    """
    found: list[int] = []
    for couple in parents:
        line = 0
        for parent in couple:
            line |= found[parent] | 1 << parent
        found.append(line)
    return found


def unique_ancestors(census: Census, lines: list[int]) -> Integers:
    """Return how many different ancestors the judged of each population have, (G,).

    Args:
        census: of a run.
        lines: as ``ancestors`` returns them.

    Source: Hupkes 2016, table 6.2 and figure 6.4.
    """
    is_judged, members = census.is_judged.tolist(), census.members.tolist()
    counts = []
    for start, end in zip(census.starts[:-1], census.starts[1:], strict=True):
        union = 0
        for index in range(start, end):
            if is_judged[index]:
                union |= lines[members[index]]
        counts.append(union.bit_count())
    return np.array(counts, np.int64)


def origins(births: pa.Table, parents: list[list[int]]) -> list[int]:
    """Return on which islands an individual and its ancestors were born, as bits."""
    homes = births["island"].to_pylist()
    found: list[int] = []
    for home, couple in zip(homes, parents, strict=True):
        line = 1 << home
        for parent in couple:
            line |= found[parent]
        found.append(line)
    return found


def foreign_share(
    census: Census, births: pa.Table, parents: list[list[int]]
) -> Numbers:
    """Return the share of the living that is not of its island's own line, (G,).

    It was born elsewhere, or has an ancestor that was. NaN in a run of one island.

    Source: own; how far migrants' descendants spread.
    """
    if len(np.unique(census.islands)) <= 1:
        return np.full(len(census), np.nan)
    lines = origins(births, parents)
    here = census.islands[census.group_of].tolist()
    pairs = zip(census.members.tolist(), here, strict=True)
    is_foreign = [lines[member] != 1 << island for member, island in pairs]
    return census.mean(np.array(is_foreign, np.float64))


def descends(lines: list[int], ancestor: int) -> Truths:
    """Return who descends from an individual, (B,); not itself.

    Args:
        lines: as ``ancestors`` returns them.
        ancestor: its births row.
    """
    return np.array([line >> ancestor & 1 for line in lines], np.bool_)
