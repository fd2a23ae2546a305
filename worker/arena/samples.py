"""Samples of the living robots' positions and channels, for their fitness windows."""

from collections.abc import Sequence

import numpy as np

from schema.experiment.settings import ArenaSettings
from schema.robot.results import Floats
from schema.robot.trace import NEIGHBOUR_M
from worker.clusters.population import ArenaPopulation
from worker.clusters.robot import ArenaRobot
from worker.measures.functions import functions_of


class Samples:
    """Adds samples to the windows of an arena's robots."""

    def __init__(self, settings: ArenaSettings, population: ArenaPopulation) -> None:
        """Find out which channels are recorded.

        Args:
            settings: of the arena.
            population: its living robots.
        """
        wanted = functions_of(settings).channels
        self._population = population
        self._is_recorded = bool(wanted)
        self._counts_neighbours = "neighbours" in wanted

    def first(self, step: int, robot: ArenaRobot) -> None:
        """Add the sample of a newborn at its place.

        Args:
            step: of the arena.
            robot: not moved since its first readings, and part of the population.
        """
        row: Floats | None = None
        if self._is_recorded:
            probe = robot.view.probe
            if probe is not None:
                probe.read()
            places = [one.place for one in self._population.robots]
            number = self._population.robot_rows.rows[robot.birth]
            row = robot.body.channels.row(
                robot.view.qpos,
                robot.view.qvel,
                probe=None if probe is None else probe.numbers,
                readings=robot.view.sensors.readings,
                neighbours=self._neighbours(places)[number],
            )
        robot.window.add(step, robot.place, row)

    def add(self, step: int, state: Floats) -> None:
        """Add a sample of each robot, at the present moment of an interval.

        Args:
            step: of the arena.
            state: of all clusters, (W,) in the order of the layout.
        """
        layout, robots = self._population.layout, self._population.robots
        places = state[layout.roots[:, :3]].tolist()
        for robot, (x, y, z) in zip(robots, places, strict=True):
            robot.place = (x, y, z)
            if not self._is_recorded:
                robot.window.add(step, robot.place)
        if self._is_recorded:
            self._record(step, state)

    def _record(self, step: int, state: Floats) -> None:
        population, layout = self._population, self._population.layout
        rollout = population.rollout
        assert rollout is not None
        neighbours = self._neighbours([robot.place for robot in population.robots])
        sizes = layout.robot_rows.sizes.tolist()
        dofs = layout.motions[:, 0].tolist()
        for number, robot in enumerate(population.robots):
            start, dof = int(layout.starts[number]), dofs[number]
            cluster = population.cluster_of[robot.birth]
            probed = cluster.history.probed[rollout.moment]
            row = robot.body.channels.row(
                state[start : start + sizes[number]],
                state[dof : dof + sizes[number] - 1],
                probe=probed[cluster.members.index(robot.birth)] if probed else None,
                readings=robot.view.sensors.readings,
                neighbours=neighbours[number],
            )
            robot.window.add(step, robot.place, row)

    def _neighbours(self, places: Sequence[Sequence[float]]) -> list[int]:
        """Return how many robots are near each one; 0 if nothing needs it.

        Args:
            places: of the cores, by birth [m].
        """
        if not self._counts_neighbours:
            return [0] * len(places)
        at = np.array(places)
        apart = at[:, np.newaxis] - at
        is_near = (apart * apart).sum(axis=2) <= NEIGHBOUR_M**2
        counts: list[int] = (is_near.sum(axis=1) - 1).tolist()
        return counts
