"""A run's tables, and what several measures derive from them."""

from collections.abc import Mapping
from functools import cached_property

import pyarrow as pa

from analysis.measures.ancestry import ancestors, parents_of
from analysis.measures.bodies import body_sizes
from analysis.measures.population_table import (
    Numbers,
    PopulationTable,
    population_table,
)
from analysis.measures.trees import SlotRule, Trees, encode

Refusals = dict[str, str]
"""Why a measure could not be had, by its name."""


class RunTables:
    """A run's tables, and what several measures derive from them, once.

    Attributes:
        tables: by name, as ``analysis.measures.load.read_tables`` returns them: births,
            evaluations, population, fitness, deaths, touches, migrations.
        slots: whose slot counts in tree edit distance.
    """

    def __init__(
        self, tables: Mapping[str, pa.Table], slots: SlotRule = "parent"
    ) -> None:
        self.tables = tables
        self.slots = slots

    @property
    def births(self) -> pa.Table:
        """The births table."""
        return self.tables["births"]

    @cached_property
    def population_table(self) -> PopulationTable:
        """Who is alive when."""
        return population_table(self.tables["population"], self.births)

    @cached_property
    def trees(self) -> Trees:
        """The bodies as trees."""
        return encode(self.births["body"], self.slots)

    @cached_property
    def parents(self) -> list[list[int]]:
        """Births rows of each individual's parents."""
        return parents_of(self.births)

    @cached_property
    def lines(self) -> list[int]:
        """Each individual's ancestors."""
        return ancestors(self.parents)

    @cached_property
    def sizes(self) -> dict[str, Numbers]:
        """Sizes of each individual."""
        return body_sizes(self.births)
