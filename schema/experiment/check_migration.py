"""Whether a migration can happen: one that cannot is an error, never silence."""

from math import ceil

from schema.experiment.document import Experiment, island_count, island_experiment
from schema.experiment.migration import Migration, migrant_count

_UNCONNECTED = (
    "migration.topology: nobody can migrate between unconnected islands; name another "
    "topology, or leave out the rest of [migration]"
)


def migration_problem(experiment: Experiment) -> str:
    """Return why an experiment's migration cannot be, or nothing.

    Each island's other sections have been found to fit each other.
    """
    migration, count = experiment.migration, island_count(experiment)
    if migration is None:
        if not any(islands.migration for islands in experiment.islands):
            return ""
        return "migration: must say how the islands of [[islands]] are connected"
    if migration.topology == "unconnected":
        return "" if migration == Migration() else _UNCONNECTED
    if count == 1:
        return "migration: one island has nobody to migrate to; add [[islands]]"
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
            return f"migration.edges: must stand there once, got {list(edge)} twice"
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
            f"migration.degree: must be even where the islands are odd, {count}, "
            f"got {degree}"
        )
    if migration.topology == "small-world" and degree % 2:
        return f"migration.degree: must be even in a small world, got {degree}"
    return ""


def _island_problem(experiment: Experiment, number: int) -> str:
    """Return why one island of several could not migrate, or nothing."""
    connected, own = experiment.migration, island_experiment(experiment, number)
    migration = own.migration
    assert connected is not None
    assert migration is not None
    for name in ("topology", "degree", "p_rewire", "edges"):
        if getattr(migration, name) != getattr(connected, name):
            return f"migration.{name}: is the archipelago's, not that of some islands"
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
    """Off-line an epoch ends with a brood; the last brood ends all."""
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
            f"migration.migrants: a share of {migration.migrants:g} of {living} is "
            "nobody"
        )
    if isinstance(migration.migrants, int) and migration.migrants > living:
        return (
            f"migration.migrants: must be <= {living}, those who live there at most, "
            f"got {migration.migrants}"
        )
    stay = selection.parents_needed
    if migration.handling == "evict" and living <= stay:
        return (
            f'migration.handling: "evict" leaves at least {stay} on their island, and '
            f"no more than {living} live there"
        )
    return ""


def _replaced_problem(own: Experiment, migration: Migration) -> str:
    varies = own.arena is not None or own.selection.culling is not None
    if varies or migration.replaced != "none":
        return ""
    return (
        'migration.replaced: "none" is for islands where the number of the living '
        "varies; off-line, without selection.culling, it is selection.population"
    )


def _seconds_problem(experiment: Experiment, migration: Migration, count: int) -> str:
    arenas = [island_experiment(experiment, number).arena for number in range(count)]
    if migration.epoch_s is None or any(arena is not None for arena in arenas):
        return ""
    return "migration.epoch_s: simulated seconds pass in arenas only, and there is none"
