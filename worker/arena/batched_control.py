"""Brains of all robots of an arena, in one batch; sensors that see other robots.

The arithmetic is that of ``worker.robot``, equal to the last bit. Sensors and motors
are read and commanded one by one: that takes less than a hundredth of the physics.
"""

from collections.abc import Sequence

import numpy as np

from schema.errors import SensorFailed
from schema.experiment.settings import ArenaSettings
from schema.plugins.protocols import Bank
from schema.robot.trace import Floats
from schema.wire.arena import Casualty
from worker.clusters.population import ArenaPopulation
from worker.clusters.robot import ArenaRobot
from worker.filters.filters import Filter, filtered_outputs, filtered_readings
from worker.filters.noise import Noise
from worker.robot.banks import broken_rows
from worker.robot.brains import Controls
from worker.robot.own_sensors import Surroundings


class BatchedControllers:
    """One bank of brains, a row per robot, by birth.

    A robot's first tick is at its birth, as off-line. Births fall on ticks of the
    arena, so from then on all brains tick together.

    Attributes:
        broken: why the brain of a robot broke at the last tick, by row, ascending;
            only code of users can do that.
    """

    def __init__(self, settings: ArenaSettings, controls: Controls) -> None:
        self._controls = controls
        self._tick_steps = settings.simulation.brain_steps
        self.broken: dict[int, str] = {}
        self.change(settings, ())

    def change(self, settings: ArenaSettings, robots: Sequence[ArenaRobot]) -> None:
        """Give the sensors and motors of all robots the noise of settings."""
        simulation = settings.simulation
        self._settings = settings
        self._is_noisy = bool(simulation.sensor_noise or simulation.actuator_noise)
        self.gather(robots)

    def gather(self, robots: Sequence[ArenaRobot]) -> None:
        """Rebuild the bank; each robot's states are moved to its row."""
        self._bank, self._filters = self._rows_of(robots)
        for robot, states in zip(robots, self._bank.states, strict=True):
            states[:] = robot.states
            robot.states = states
        starts = [robot.brain_start for robot in robots]
        self._starts = np.array(starts, dtype=np.float64)[:, None]

    def tick(self, step: int, robots: Sequence[ArenaRobot]) -> Floats:
        """Update all brains with the latest readings and return their outputs.

        They are (R, O), unclipped; may be a view that the next tick overwrites.
        """
        ages = (step - self._starts) // self._tick_steps
        outputs = self._outputs(robots, self._bank, self._filters, step, ages)
        self.broken = broken_rows(self._bank, outputs)
        return outputs

    def first_tick(self, step: int, robot: ArenaRobot) -> str:
        """Update a newborn's brain alone, command its motors; return why it broke."""
        bank, filters = self._rows_of([robot])
        outputs = self._outputs([robot], bank, filters, step, 0.0)
        robot.view.servos.drive(outputs[0])
        robot.states = bank.states[0]
        return broken_rows(bank, outputs).get(0, "")

    def _rows_of(self, robots: Sequence[ArenaRobot]) -> tuple[Bank, tuple[Filter, ...]]:
        """Return a bank at rest and the filters of some robots."""
        bank = self._controls.guarded_bank([robot.packed for robot in robots])
        if not self._is_noisy:
            return bank, ()
        births = [robot.birth for robot in robots]
        clock, origin = self._settings.simulation, self._settings.origin
        return bank, (Noise(clock, self._controls.width, origin, births),)

    def _outputs(
        self,
        robots: Sequence[ArenaRobot],
        bank: Bank,
        filters: tuple[Filter, ...],
        step: int,
        ages: Floats | float,
    ) -> Floats:
        """Return the outputs of brains; each robot keeps those that are recorded."""
        tick = step // self._tick_steps
        rows = [robot.view.sensors.readings for robot in robots]
        readings = np.concatenate([np.zeros((0, self._controls.width.inputs)), *rows])
        outputs = bank.step(filtered_readings(filters, tick, readings), ages)
        for robot, row in zip(robots, outputs, strict=True):
            robot.outputs[:] = row[: len(robot.outputs)]
        return filtered_outputs(filters, tick, outputs)


def look(
    population: ArenaPopulation, robots: Sequence[ArenaRobot], step: int
) -> list[Casualty]:
    """Write readings of light sensors and own ones; return robots of failed sensors."""
    looking = [robot for robot in robots if robot.view.sensors.looks]
    if not looking:
        return []
    population.kinematics()
    settings = population.model_cache.present
    places = np.array([robot.view.qpos[:3] for robot in population.robots])
    rows = population.robot_rows.rows
    failed = []
    for robot in looking:
        sensors = robot.view.sensors
        cluster = population.cluster_of[robot.birth]
        is_newborn = step == robot.window.born
        around = Surroundings(
            (step - robot.window.born) * settings.simulation.timestep_s,
            # Nothing has been stepped since a birth.
            sensors.touching() if is_newborn else cluster.touched,
            [(c.model, c.data) for c in population.clusters if c is not cluster],
            np.delete(places, rows[robot.birth], axis=0),
            settings.light,
            population.patch_lights,
        )
        try:
            sensors.look(around)
        except SensorFailed as error:
            x, y, z = robot.view.qpos[:3].tolist()
            failed.append(Casualty(robot.birth, step, str(error), (x, y, z)))
    return failed
