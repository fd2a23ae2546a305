"""What holds for the robots and clusters of an arena between any two operations."""

from itertools import chain, pairwise

import numpy as np

from worker.clusters.cluster import Cluster
from worker.clusters.population import ArenaPopulation


def check_population(population: ArenaPopulation) -> None:
    """Assert that clusters are a partition, and that columns belong to their robots."""
    _check_partition(population)
    _check_views(population)
    _check_columns(population)
    _check_spheres(population)


def _check_partition(population: ArenaPopulation) -> None:
    births = [robot.birth for robot in population.robots]
    clusters = population.clusters
    assert births == sorted(set(births))
    assert list(population.robot_rows.rows) == births
    assert sorted(chain.from_iterable(c.members for c in clusters)) == births
    assert [c.members for c in clusters] == sorted(c.members for c in clusters)
    assert all(c.members == tuple(sorted(c.members)) for c in clusters)
    owners = {birth: c for c in clusters for birth in c.members}
    assert population.cluster_of == owners
    assert set(population.by_cost) == set(clusters)
    assert population.rollout is None


def _check_views(population: ArenaPopulation) -> None:
    """A robot has its slice of its cluster, the slices of which do not overlap."""
    for cluster in population.clusters:
        for birth, view in zip(cluster.members, cluster.views, strict=True):
            robot = population.find(birth)
            assert robot.view is view
            assert (view.model, view.data) == (cluster.model, cluster.data)
            assert np.shares_memory(view.qpos, cluster.data.qpos)
            assert len(view.qpos) == robot.body.solo.model.nq
            assert len(view.servos.motors) == len(view.ctrl)
        for name in ("joints", "dofs"):
            slices = sorted(
                (getattr(view, name).start, getattr(view, name).stop)
                for view in cluster.views
            )
            assert all(end <= start for (_, end), (start, _) in pairwise(slices))
        if len(cluster.members) == 1:
            assert cluster is population.find(cluster.members[0]).body.solo


def _check_columns(population: ArenaPopulation) -> None:
    """Rows of a layout are those of the robots, in clusters' own columns."""
    layout, state = population.layout, population.layout.read()
    assert layout.clusters == population.clusters
    assert layout.robot_rows is population.robot_rows
    angles = state[layout.joints]
    for row, robot in enumerate(population.robots):
        view = robot.view
        cluster = layout.clusters[layout.cluster_indices[row]]
        assert cluster is population.cluster_of[robot.birth]
        size = population.robot_rows.sizes[row]
        start = layout.starts[row]
        assert state[layout.roots[row]].tobytes() == view.qpos[:7].tobytes()
        assert state[start : start + size].tobytes() == view.qpos.tobytes()
        assert state[layout.motions[row]].tobytes() == view.qvel[:6].tobytes()
        assert angles[: size - 7].tobytes() == view.qpos[7:].tobytes()
        angles = angles[size - 7 :]
    assert not len(angles)
    taken = sorted((_first_column(population, c), c.size) for c in layout.clusters)
    ends = [start + width for start, width in taken]
    assert all(end <= start for end, (start, _) in zip(ends, taken[1:], strict=False))
    assert not ends or ends[-1] <= layout.states.shape[1]


def _first_column(population: ArenaPopulation, cluster: Cluster) -> int:
    states = population.layout.states
    kept = cluster.history.state
    assert np.shares_memory(kept, states)
    offset = kept.ctypes.data - states.ctypes.data
    return int(offset // states.itemsize)


def _check_spheres(population: ArenaPopulation) -> None:
    """Spheres that are picked out of the state are those of the robots' own bodies."""
    population.kinematics()
    layout, rows = population.layout, population.robot_rows
    spheres = np.arange(len(rows.radii))
    (centres,) = layout.spheres(layout.read()[np.newaxis], spheres)
    expected = []
    for robot in population.robots:
        bounds, view = robot.body.bounds, robot.view
        root = view.root
        for body, centre in zip(bounds.bodies, bounds.centres[:, :3], strict=True):
            frame = view.data.xmat[root + body].reshape(3, 3)
            expected.append(view.data.xpos[root + body] + frame @ centre)
    assert np.allclose(centres.T, np.array(expected).reshape(-1, 3), atol=1e-12)
