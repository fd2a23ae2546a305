"""Fitness and measures of robots, in the order of births on their islands."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from analysis.measures.population_table import (
    Booleans,
    Numbers,
    PopulationTable,
    individual_ids,
    rows_of,
)
from schema.robot.trees import Integers


@dataclass(frozen=True, slots=True)
class Samples:
    """Fitness and M measures of robots, by island and births; S samples.

    Off-line there is one of each robot, its evaluation at birth, on-line one of each
    sample of a mature robot. Failed evaluations are none.

    Attributes:
        islands: (S,) island.
        births: (S,) births on the island so far; 0 of immigrants off-line.
        robots: (S,) births row of the robot.
        fitness: (S,).
        values: (S, M) measures.
    """

    islands: Integers
    births: Integers
    robots: Integers
    fitness: Numbers
    values: Numbers

    def __len__(self) -> int:
        return len(self.births)

    def __getitem__(self, rows: Booleans | Integers) -> "Samples":
        """Return some of the samples."""
        return Samples(
            self.islands[rows],
            self.births[rows],
            self.robots[rows],
            self.fitness[rows],
            self.values[rows],
        )

    def born_on(self, island: int) -> "Samples":
        """Return those of an island, without immigrants off-line."""
        return self[(self.islands == island) & (self.births > 0)]

    def of_members(self, table: PopulationTable) -> Integers:
        """Return the last sample of each member by then, (N,); -1 if there is none."""
        if not len(self):
            return np.full(len(table.members), -1, np.int64)
        robots = 1 + max(self.robots.max(), table.members.max(initial=0))
        births = 1 + max(self.births.max(), table.births.max(initial=0))
        known = (self.islands * robots + self.robots) * births + self.births
        groups = table.group_of
        lived = table.islands[groups] * robots + table.members
        order = np.argsort(known, kind="stable")
        wanted = lived * births + table.births[groups]
        place = np.searchsorted(known[order], wanted, side="right") - 1
        last = order[np.maximum(place, 0)]
        is_own = (place >= 0) & (known[last] // births == lived)
        found: Integers = np.where(is_own, last, -1)
        return found


def samples(
    evaluations: pa.Table, fitness: pa.Table, births: pa.Table, names: Sequence[str]
) -> Samples:
    """Return the samples of a run, given three of its tables, with named measures."""
    first = evaluations.filter(pc.field("trial") == 0)
    is_native = np.equal(first["island"], first["birth_island"])
    born = np.where(is_native, np.asarray(first["birth"], np.int64) + 1, 0)
    mature = fitness.filter(pc.field("is_mature"))
    parts = [(first, born), (mature, np.asarray(mature["births"], np.int64))]
    columns: list[tuple[Any, ...]] = [
        (
            np.asarray(table["island"], np.int64),
            so_far,
            rows_of(individual_ids(table), births),
            np.asarray(table["fitness"].to_numpy(), np.float64),
            _measures(table, names),
        )
        for table, so_far in parts
    ]
    every = Samples(*(np.concatenate(pair) for pair in zip(*columns, strict=True)))
    is_known = ~np.isnan(every.values).any(axis=1) & ~np.isnan(every.fitness)
    known = every[is_known & (every.robots >= 0)]
    return known[np.lexsort((known.births, known.islands))]


def _measures(table: pa.Table, names: Sequence[str]) -> Numbers:
    """Return named measures of rows, (N, M); NaN where one is not known."""
    lists = table["measures"].combine_chunks()
    columns = [
        pc.map_lookup(lists, pa.scalar(name), "first").to_numpy(zero_copy_only=False)
        for name in names
    ]
    return np.stack([np.asarray(each, np.float64) for each in columns], axis=1)
