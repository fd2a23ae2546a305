"""Checks that the migration of an experiment can happen."""

from math import ceil

from schema.experiment.document import Experiment, island_count, island_experiment
from schema.experiment.migration import Migration, migrant_count

_UNCONNECTED = (
    "migration.topology: unconnected islands cannot exchange migrants; choose another "
    "topology, or remove the other keys of [migration]"
)


def migration_problem(experiment: Experiment) -> str:
    """Return what is wrong with an experiment's migration, or nothing.

    Args:
        experiment: its other sections are consistent.
    """
    migration, count = experiment.migration, island_count(experiment)
    if migration is None:
        if not any(islands.migration for islands in experiment.islands):
            return ""
        return "migration: is missing; [[islands]] with a migration need it"
    if migration.topology == "unconnected":
        return "" if migration == Migration() else _UNCONNECTED
    if count == 1:
        return "migration: needs at least two islands; add [[islands]]"
    problems = [
        _edges_problem(migration, count),
        _degree_problem(migration, count),
        *(_island_problem(experiment, number) for number in range(count)),
        _seconds_problem(experiment, migration, count),
    ]
    return next(filter(None, problems), "")


def _edges_problem(migration: Migration, count: int) -> str:
    edges = migration.edges
    if migration.topology != "edges":
        return 'migration.edges: needs topology = "edges"' if edges else ""
    if not edges:
        return "migration.edges: must be pairs of islands, got none"
    for edge in edges:
        if max(edge) >= count:
            return (
                f"migration.edges: islands are 0..{count - 1}, got {list(edge)}; "
                "[[islands]] says how many there are"
            )
        if edge[0] == edge[1]:
            return f"migration.edges: must be two islands, got {list(edge)}"
        if edges.count(edge) > 1:
            return f"migration.edges: must not repeat a pair, got {list(edge)} twice"
    return ""


def _degree_problem(migration: Migration, count: int) -> str:
    if migration.topology not in ("random-regular", "small-world"):
        return ""
    degree = migration.degree
    lowest = 1 if migration.topology == "random-regular" else 2
    if not lowest <= degree < count:
        return (
            f"migration.degree: must be >= {lowest} and < {count}, the number of "
            f"islands, got {degree}"
        )
    if migration.topology == "random-regular" and degree * count % 2:
        return (
            f"migration.degree: must be even for an odd number of islands, {count}, "
            f"got {degree}"
        )
    if migration.topology == "small-world" and degree % 2:
        return f"migration.degree: must be even in a small world, got {degree}"
    return ""


def _island_problem(experiment: Experiment, number: int) -> str:
    """Return what is wrong with the migration of one island, or nothing."""
    connected, own = experiment.migration, island_experiment(experiment, number)
    migration = own.migration
    assert connected is not None
    assert migration is not None
    for name in ("topology", "degree", "p_rewire", "edges"):
        if getattr(migration, name) != getattr(connected, name):
            return f"migration.{name}: must be the same on all islands"
    if connected.topology == "edges" and not any(
        number in edge for edge in connected.edges
    ):
        return ""
    checks = (_epoch_problem, _migrants_problem, _replaced_problem)
    for check in checks:
        if problem := check(own, migration):
            return f"{problem} (island {number})"
    return ""


def _epoch_problem(own: Experiment, migration: Migration) -> str:
    """Return whether the first epoch would end after the last birth."""
    founders, epoch = own.selection.population, migration.epoch
    first = max(epoch, founders)
    if own.arena is None:
        broods = ceil((first - founders) / own.selection.children)
        first = founders + broods * own.selection.children
    elif migration.epoch_s is not None:
        return ""
    if first < own.births:
        return ""
    return (
        f"migration.epoch: its first epoch of {epoch} births would end with birth "
        f"{first}, but the island ends with birth {own.births}"
    )


def _migrants_problem(own: Experiment, migration: Migration) -> str:
    selection, arena = own.selection, own.arena
    living = selection.population if arena is None else arena.population_limit
    if migrant_count(migration, living) == 0:
        return (
            f"migration.migrants: a share of {migration.migrants:g} of {living} rounds "
            "to 0"
        )
    if isinstance(migration.migrants, int) and migration.migrants > living:
        return (
            f"migration.migrants: must be <= {living}, the population of the "
            f"island, got {migration.migrants}"
        )
    stay = selection.parents_needed
    if migration.handling == "evict" and living <= stay:
        return (
            f'migration.handling: "evict" keeps at least {stay} robots on an island, '
            f"and at most {living} live there"
        )
    return ""


def _replaced_problem(own: Experiment, migration: Migration) -> str:
    varies = own.arena is not None or own.selection.culling is not None
    if varies or migration.replaced != "none":
        return ""
    return (
        'migration.replaced: "none" needs a population of varying size; '
        "off-line it varies only with selection.culling"
    )


def _seconds_problem(experiment: Experiment, migration: Migration, count: int) -> str:
    arenas = [island_experiment(experiment, number).arena for number in range(count)]
    if migration.epoch_s is None or any(arena is not None for arena in arenas):
        return ""
    return "migration.epoch_s: applies to arenas only, and the experiment has none"
