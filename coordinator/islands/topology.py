"""Topology: which islands of an archipelago are neighbours.

Source: networkx builds the graphs; the small world is that of Watts and Strogatz
1998, drawn until it is connected.
"""

from collections.abc import Callable
from math import isqrt
from typing import Any

from coordinator.evolution.random_streams import Purpose, stream
from schema.errors import ExperimentError
from schema.experiment.migration import Migration
from schema.robot.ids import BirthId

Edge = tuple[int, int]
"""Numbers of the source and the target island."""


def connections(
    migration: Migration, islands: int, seed: int, run: int
) -> tuple[Edge, ...]:
    """Return the directed edges along which migrants travel, in order.

    Only random topologies depend on the seed and the number of the repeat.

    Raises:
        ExperimentError: networkx cannot build the graph, e.g. a connected small world
            of that degree.
    """
    if migration.topology == "unconnected":
        return ()
    if migration.topology == "edges":
        return tuple(sorted(migration.edges))
    rng = stream(seed, run, BirthId(0, 0), 0, Purpose.TOPOLOGY)
    edges = _graph(migration, islands, int(rng.integers(2**32)))
    return tuple(sorted([*edges, *((to, source) for source, to in edges)]))


def _graph(migration: Migration, islands: int, seed: int) -> list[Edge]:
    # A large package that only archipelagos need.
    """Return the edges of an undirected graph, each once."""
    import networkx as nx  # noqa: PLC0415

    # The most square grid.
    sides = range(1, isqrt(islands) + 1)
    rows = max(side for side in sides if islands % side == 0)
    degree, p_rewire = migration.degree, migration.p_rewire
    make: dict[str, Callable[[], Any]] = {
        "ring": lambda: nx.cycle_graph(islands),
        "fully-connected": lambda: nx.complete_graph(islands),
        "star": lambda: nx.star_graph(islands - 1),
        "grid": lambda: nx.convert_node_labels_to_integers(
            nx.grid_2d_graph(rows, islands // rows), ordering="sorted"
        ),
        "random-regular": lambda: nx.random_regular_graph(degree, islands, seed),
        "small-world": lambda: nx.connected_watts_strogatz_graph(
            islands, degree, p_rewire, seed=seed
        ),
    }
    try:
        graph = make[migration.topology]()
    except nx.NetworkXError as error:
        raise ExperimentError(f"migration.topology: {error}") from None
    return [(int(one), int(other)) for one, other in graph.edges]
