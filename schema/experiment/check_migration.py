"""Checks that the migration of an experiment can happen."""

from collections.abc import Iterator
from itertools import chain
from math import ceil

from schema.experiment.document import Experiment, island_count, island_experiments
from schema.experiment.migration import Migration, migrant_count
from schema.experiment.selection_rules import rule_problems

_UNCONNECTED = """migration.topology: unconnected islands cannot exchange migrants; \
choose another topology, or remove the other keys of [migration]"""


def migration_problems(experiment: Experiment) -> Iterator[str]:
    """Yield what is wrong with the migration of an otherwise consistent experiment."""
    migration, count = experiment.migration, island_count(experiment)
    if migration is None:
        if any(islands.migration for islands in experiment.islands):
            yield "migration: is missing; [[islands]] with a migration need it"
        return
    if migration.topology == "unconnected":
        if migration != Migration():
            yield _UNCONNECTED
        return
    if count == 1:
        yield "migration: needs at least two islands; add [[islands]]"
    yield from _edges_problems(migration, count)
    yield from _degree_problems(migration, count)
    islands = island_experiments(experiment)
    for number, island in enumerate(islands):
        yield from _island_problems(island, migration, number)
    if migration.epoch_s is not None and not any(island.arena for island in islands):
        yield "migration.epoch_s: applies to arenas only, and the experiment has none"


def _edges_problems(migration: Migration, count: int) -> Iterator[str]:
    edges = migration.edges
    if migration.topology != "edges" and edges:
        yield 'migration.edges: needs topology = "edges"'
    if migration.topology == "edges" and not edges:
        yield "migration.edges: must be pairs of islands, got none"
    for edge in edges:
        if max(edge) >= count:
            yield f"migration.edges: islands are 0..{count - 1}, got {list(edge)}"
        if edge[0] == edge[1]:
            yield f"migration.edges: must be two islands, got {list(edge)}"
        if edges.count(edge) > 1:
            yield f"migration.edges: must not repeat a pair, got {list(edge)} twice"


def _degree_problems(migration: Migration, count: int) -> Iterator[str]:
    if migration.topology not in ("random-regular", "small-world"):
        return
    degree = migration.degree
    lowest = 1 if migration.topology == "random-regular" else 2
    if not lowest <= degree < count:
        rule = f"must be >= {lowest} and < {count}, the number of islands"
        yield f"migration.degree: {rule}, got {degree}"
    if migration.topology == "random-regular" and degree * count % 2:
        yield f"migration.degree: must be even for {count} islands, got {degree}"
    if migration.topology == "small-world" and degree % 2:
        yield f"migration.degree: must be even in a small world, got {degree}"


def _island_problems(
    own: Experiment, connected: Migration, number: int
) -> Iterator[str]:
    """Yield what is wrong with the migration of one island."""
    assert own.migration is not None
    for name in ("topology", "degree", "p_rewire", "edges"):
        if getattr(own.migration, name) != getattr(connected, name):
            yield f"migration.{name}: must be the same on all islands"
    yield from rule_problems(own.migration)
    if connected.topology == "edges" and number not in chain(*connected.edges):
        return
    for problem in _exchange_problems(own, own.migration):
        yield f"{problem} (island {number})"


def _exchange_problems(own: Experiment, migration: Migration) -> Iterator[str]:
    """Yield which exchange of migrants of a connected island is impossible."""
    selection, arena = own.selection, own.arena
    founders, epoch = selection.population, migration.epoch
    first = max(epoch, founders)
    if arena is None:
        broods = ceil((first - founders) / selection.children)
        first = founders + broods * selection.children
    if first >= own.births and (arena is None or migration.epoch_s is None):
        end = f"the first of {epoch} births would end with birth {first}"
        yield f"migration.epoch: {end}, but the island ends with birth {own.births}"
    living = selection.population if arena is None else arena.population_limit
    if migrant_count(migration, living) == 0:
        yield f"migration.migrants: {migration.migrants:g} of {living} rounds to 0"
    if isinstance(migration.migrants, int) and migration.migrants > living:
        rule = f"must be <= {living}, the population of the island"
        yield f"migration.migrants: {rule}, got {migration.migrants}"
    stay = selection.parents_needed
    if migration.handling == "evict" and living <= stay:
        yield (
            f'migration.handling: "evict" keeps at least {stay} robots on an island, '
            f"and at most {living} live there"
        )
    if migration.replaced == "none" and not (arena or selection.culling):
        varies = "off-line it varies only with selection.culling"
        yield f'migration.replaced: "none" needs a varying population; {varies}'
