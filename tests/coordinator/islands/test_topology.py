"""Topologies: the edges of each kind of graph."""

from typing import Any

import networkx as nx
import pytest

from coordinator.islands.topology import Edge, connections
from schema.experiment.migration import Migration, Topology


def both(*pairs: tuple[int, int]) -> tuple[tuple[int, int], ...]:
    """Return edges both ways, in order."""
    return tuple(sorted([*pairs, *((b, a) for a, b in pairs)]))


def edges(
    topology: Topology,
    islands: int,
    seed: int = 1,
    **keys: Any,  # noqa: ANN401 - any setting
) -> tuple[Edge, ...]:
    migration = Migration(topology=topology, **keys)
    return connections(migration, islands, seed, 0)


@pytest.mark.parametrize(
    ("topology", "islands", "expected"),
    [
        ("unconnected", 4, ()),
        ("ring", 4, both((0, 1), (1, 2), (2, 3), (3, 0))),
        ("ring", 2, both((0, 1))),
        ("fully-connected", 3, both((0, 1), (0, 2), (1, 2))),
        ("star", 4, both((0, 1), (0, 2), (0, 3))),
        # 0 1 2
        # 3 4 5
        ("grid", 6, both((0, 1), (1, 2), (3, 4), (4, 5), (0, 3), (1, 4), (2, 5))),
        # A prime number gives a line.
        ("grid", 3, both((0, 1), (1, 2))),
    ],
)
def test_edges_by_hand(
    topology: Topology, islands: int, expected: tuple[Edge, ...]
) -> None:
    assert edges(topology, islands) == expected


def test_the_user_s_edges_go_one_way() -> None:
    assert edges("edges", 3, edges=((2, 0), (0, 1))) == ((0, 1), (2, 0))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_all_islands_of_a_random_regular_graph_have_the_same_degree(seed: int) -> None:
    found = edges("random-regular", 10, seed, degree=3)
    graph: nx.DiGraph[int] = nx.DiGraph(found)
    assert {graph.out_degree(island) for island in range(10)} == {3}
    assert {graph.in_degree(island) for island in range(10)} == {3}


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_small_world_is_connected_and_as_dense_as_its_ring(seed: int) -> None:
    found = edges("small-world", 12, seed, degree=4, p_rewire=0.3)
    graph: nx.Graph[int] = nx.Graph(found)
    assert nx.is_connected(graph)
    assert graph.number_of_edges() == 24


def test_random_topologies_depend_on_the_seed_alone() -> None:
    drawn = [edges("random-regular", 10, seed, degree=3) for seed in (1, 1, 2)]
    assert drawn[0] == drawn[1] != drawn[2]
