"""The tables of a run, with values that several measures share."""

from collections.abc import Mapping, Sequence
from functools import cached_property

import pyarrow as pa

from analysis.measures.ancestry import ancestors, parents_of
from analysis.measures.bodies import SlotRule, body_sizes, encode
from analysis.measures.brains.measures import brain_measures
from analysis.measures.diversity.samples import samples
from analysis.measures.population_table import (
    Numbers,
    PopulationTable,
    population_table,
)
from schema.experiment.document import Experiment
from schema.experiment.grid import Grid
from schema.robot.trees import Trees

Problems = dict[str, str]
"""Reasons why measures were left out, by the name of the measure."""


class RunTables:
    """The tables of a run, with values that several measures share.

    Attributes:
        tables: by name, as ``analysis.measures.load.read_tables`` returns them: births,
            evaluations, population, fitness, deaths, touches, migrations, learning.
        slots: slot that labels a part in tree edit distance.
        islands: settings of the islands; without them a run has neither arenas nor
            robots that are evaluated again.
    """

    def __init__(
        self,
        tables: Mapping[str, pa.Table],
        slots: SlotRule = "parent",
        islands: Sequence[Experiment] = (),
    ) -> None:
        self.tables = tables
        self.slots = slots
        self.islands = islands

    @property
    def births(self) -> pa.Table:
        """Births table."""
        return self.tables["births"]

    @cached_property
    def population_table(self) -> PopulationTable:
        """Recorded populations."""
        return population_table(self.tables["population"], self.births)

    @property
    def grid(self) -> Grid | None:
        """Cells over measures, of all islands."""
        return self.islands[0].grid if self.islands else None

    @cached_property
    def samples(self) -> pa.Table:
        """Fitness and, with a grid, its measures, of robots by island and births."""
        evaluations, fitness = (self.tables[n] for n in ("evaluations", "fitness"))
        names = self.grid.measures if self.grid else ()
        return samples(evaluations, fitness, self.births, names)

    @cached_property
    def trees(self) -> Trees:
        """Bodies as trees."""
        return encode(self.births["body"], self.slots)

    @cached_property
    def parents(self) -> list[list[int]]:
        """Births rows of each individual's parents."""
        return parents_of(self.births)

    @cached_property
    def lines(self) -> list[int]:
        """Ancestors of each individual, as bits."""
        return ancestors(self.parents)

    @cached_property
    def sizes(self) -> dict[str, Numbers]:
        """Sizes of each individual."""
        return body_sizes(self.births)

    @cached_property
    def brains(self) -> dict[str, Numbers]:
        """Measures of each individual's brain, by name."""
        return brain_measures(self.births, self.parents, self.trees)
