"""Elites of the cells of a grid while robots are born: the archive map of viewers."""

from collections.abc import Mapping
from typing import Annotated, Any

from msgspec import Meta, Struct, json

from schema.experiment.grid import Cell, Grid, cell_of
from schema.experiment.section import Count
from schema.limits import Finite
from schema.robot.ids import BirthId, IslandNumber
from schema.wire.codec import Message


class Elite(Message, frozen=True):
    """A robot that is the fittest of its cell so far.

    Attributes:
        island: number of the island.
        births: number of births on the island so far.
        cell: numbers of bins, in the order of the grid's measures.
        birth: id of the individual.
        fitness: of it.
    """

    island: IslandNumber
    births: Count
    cell: Annotated[tuple[Count, ...], Meta(max_length=4)]
    birth: BirthId
    fitness: Finite


class _Document(Struct):
    grid: Grid | None = None


class EliteReader:
    """Finds elites in rows of evaluations and, of arenas, fitness.

    Attributes:
        grid: of the experiment; None if it has none.
        best: the elites by island and cell.
    """

    def __init__(self, document: str) -> None:
        """Initialise without elites; ``document`` is the experiment as JSON."""
        self.grid = json.decode(document or "{}", type=_Document).grid
        self.best: dict[tuple[int, Cell], Elite] = {}

    def read(self, table: str, row: Mapping[str, Any]) -> Elite | None:
        """Return a new elite, if a row has one. Rows are in the order of births."""
        if self.grid is None or not (births := _births(table, row)):
            return None
        measures, fitness = dict(row["measures"] or ()), row["fitness"]
        if fitness is None or not measures.keys() >= set(self.grid.measures):
            return None
        cell, island = cell_of(self.grid, measures), row["island"]
        before = self.best.get((island, cell))
        if before is not None and before.fitness >= fitness:
            return None
        home = row.get("birth_island")
        birth = BirthId(island if home is None else home, row["birth"])
        new = self.best[island, cell] = Elite(island, births, cell, birth, fitness)
        return new


def _births(table: str, row: Mapping[str, Any]) -> int:
    """Return the births on the island so far; 0 if the row does not count.

    Immigrants off-line, re-evaluations, and immature robots of arenas do not.
    """
    if table == "evaluations":
        is_native = row.get("birth_island") in {None, row["island"]}
        return row["birth"] + 1 if is_native and not row.get("trial") else 0
    return row["births"] if table == "fitness" and row["is_mature"] else 0
