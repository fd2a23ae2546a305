"""Sensors, controllers and motors of all robots of an arena, in batches.

The arithmetic is that of ``worker.robot``, equal to the last bit
(tests/worker/arena/test_batched_control.py). Robots with imus elsewhere than at the
core's centre are read one by one.
"""

from collections.abc import Sequence

import numpy as np

from schema.experiment.document import Simulation
from schema.parts import Vector
from schema.plugins.protocols import Bank
from schema.robot.brain import Widths
from schema.robot.results import Floats
from worker.clusters.models import Indices
from worker.clusters.robot import ArenaRobot
from worker.clusters.states import Layout
from worker.robot.brains import Controls
from worker.robot.devices import HIGHEST_OUTPUT, LOWEST_OUTPUT, into_frame
from worker.robot.engine_view import EngineView
from worker.robot.filters import Filter, filtered_outputs, filtered_readings
from worker.robot.guarded_bank import broken_rows, guarded_bank
from worker.robot.noise import Noise, NoiseSource


class BatchedControllers:
    """One bank of brains, a row per robot, by birth.

    A robot's first tick is at its birth, as off-line. Births fall on ticks of the
    arena, so from then on all brains tick together.

    Attributes:
        broken: why the brain of a robot broke at the last tick, by row, ascending;
            only code of users can do that.
    """

    def __init__(self, source: NoiseSource, controls: Controls) -> None:
        """Initialise without robots.

        Args:
            source: parameters of noise, width of every brain, and clocks.
            controls: brains of the arena.
        """
        simulation = source.simulation
        self._source = source
        self._controls = controls
        self._is_noisy = bool(simulation.sensor_noise or simulation.actuator_noise)
        self._tick_steps = simulation.brain_steps
        self.broken: dict[int, str] = {}
        self.gather(())

    def gather(self, robots: Sequence[ArenaRobot]) -> None:
        """Rebuild the bank; each robot's states are moved to its row."""
        self._bank, self._filters = self._rows_of(robots)
        for robot, states in zip(robots, self._bank.states, strict=True):
            states[:] = robot.states
            robot.states = states
        starts = [robot.brain_start for robot in robots]
        self._starts = np.array(starts, dtype=np.float64)[:, None]

    def tick(self, step: int, readings: Floats) -> Floats:
        """Update all brains with the latest readings and return their outputs.

        Args:
            step: of the arena.
            readings: (R, I) by birth.

        Returns:
            (R, O) unclipped; may be a view that the next tick overwrites.
        """
        ages = (step - self._starts) // self._tick_steps
        outputs = self._outputs(self._bank, self._filters, step, readings, ages)
        self.broken = broken_rows(self._bank, outputs)
        return outputs

    def first_tick(self, step: int, robot: ArenaRobot) -> str:
        """Update a newborn's brain alone and command its motors.

        Args:
            step: of the arena.
            robot: the newborn, not yet in the bank.

        Returns:
            Why its brain broke; empty if it did not.
        """
        bank, filters = self._rows_of([robot])
        readings = robot.view.sensors.readings
        outputs = self._outputs(bank, filters, step, readings, 0.0)
        robot.view.servos.drive(outputs[0])
        robot.states = bank.states[0]
        return broken_rows(bank, outputs).get(0, "")

    def _rows_of(self, robots: Sequence[ArenaRobot]) -> tuple[Bank, tuple[Filter, ...]]:
        """Return a bank at rest and the filters of some robots."""
        bank = guarded_bank(self._controls, [robot.packed for robot in robots])
        if not self._is_noisy:
            return bank, ()
        return bank, (Noise(self._source, [robot.birth for robot in robots]),)

    def _outputs(
        self,
        bank: Bank,
        filters: tuple[Filter, ...],
        step: int,
        readings: Floats,
        ages: Floats | float,
    ) -> Floats:
        tick = step // self._tick_steps
        received = filtered_readings(filters, tick, readings)
        return filtered_outputs(filters, tick, bank.step(received, ages))


class BatchedIO:
    """Sensor readings and motor commands of all robots, by birth.

    Attributes:
        readings: (R, I) latest readings; each robot's sensors write to its row.
    """

    def __init__(self, width: Widths, simulation: Simulation, gravity: Vector) -> None:
        """Initialise without robots; call ``settle`` before anything else.

        Args:
            width: of every network.
            simulation: its clocks.
            gravity: of the world [m/s2].
        """
        self._width = width
        self._tick_s = simulation.brain_steps * simulation.timestep_s
        self._gravity = np.array(gravity)
        self._layout: Layout | None = None
        self._views: Sequence[EngineView | None] = ()

    def settle(self, layout: Layout) -> None:
        """Adapt to a layout; robots may have been born, died or changed cluster."""
        before, self._layout = self._layout, layout
        if layout is before:
            return
        views = [robot.view for robot in layout.robot_rows.robots]
        known = self._views
        if before is None or layout.robot_rows is not before.robot_rows:
            self._gather(views)
            known = [None] * len(views)
        self._views = views
        for row, (view, other) in enumerate(zip(views, known, strict=True)):
            if view is not other:
                view.sensors.write_to(self.readings[row : row + 1])
        # Memory views are copied faster than arrays.
        self._controls = [view.ctrl.data for view in views]
        self._read_alone = [views[row].sensors for row in self._others]
        self._cores = [views[row].sensors for row in self._simple.tolist()]
        self._orientations = layout.roots[self._simple, 3:]
        self._motions = layout.motions[self._simple]
        self._angles = layout.starts[self._motor_rows] + self._motor_offsets
        cluster_indices = layout.cluster_indices.tolist()
        self._pads = [
            (layout.clusters[cluster_indices[row]], geom)
            for row in self._padded
            for geom, _ in views[row].sensors.pads
        ]

    def read(self, state: Floats) -> None:
        """Read all sensors but light sensors.

        Args:
            state: present state of all clusters, in the order of the layout.
        """
        self._read_cores(state)
        for sensors in self._read_alone:
            sensors.read(self._tick_s)
        touches = [geom in cluster.touched for cluster, geom in self._pads]
        self.readings.reshape(-1)[self._pad_places] = touches

    def drive(self, state: Floats, outputs: Floats) -> None:
        """Command all motors, until the next tick.

        Args:
            state: of all clusters, in the order of the layout.
            outputs: (R, O) of all networks, unclipped.
        """
        share = outputs[self._motor_rows, self._motor_outputs]
        np.maximum(share, LOWEST_OUTPUT, out=share)
        np.minimum(share, HIGHEST_OUTPUT, out=share)
        low, span, gain, fastest = self._motors
        target = low + share * span
        command = gain * (target - state[self._angles])
        np.maximum(command, -fastest, out=command)
        np.minimum(command, fastest, out=command)
        if len(self._free):
            command[self._free] = target[self._free]
        commands, start = command.data, 0
        for controls in self._controls:
            end = start + len(controls)
            controls[:] = commands[start:end]
            start = end

    def _gather(self, views: Sequence[EngineView]) -> None:
        """Build the arrays of all robots."""
        readings = [view.sensors.readings for view in views]
        self.readings = np.concatenate([np.zeros((0, self._width.inputs)), *readings])
        width = self._width.inputs
        self._padded = [row for row, view in enumerate(views) if view.sensors.pads]
        self._pad_places: Indices = np.array(
            [
                row * width + p
                for row in self._padded
                for _, p in views[row].sensors.pads
            ],
            dtype=np.intp,
        )
        simple = [row for row, view in enumerate(views) if view.sensors.is_simple]
        self._others = sorted(set(range(len(views))).difference(simple))
        self._simple = np.array(simple, dtype=np.intp)
        before = [views[row].sensors.velocities[0] for row in simple]
        self._velocities: Floats = np.array(before).reshape(-1, 3)
        cores = [views[row].sensors.core_imu for row in simple]
        self._places = self._simple * self._width.inputs + np.array(cores, np.intp)
        counts = np.array([len(view.ctrl) for view in views], dtype=np.intp)
        self._motor_rows = np.repeat(np.arange(len(views)), counts)
        ends = np.cumsum(counts)
        first = np.repeat(ends - counts, counts)
        self._motor_outputs: Indices = np.arange(len(first)) - first
        motors = [
            (address - view.joints.start, *limits)
            for view in views
            for address, *limits in view.servos.motors
        ]
        table = np.array(motors, dtype=np.float64).reshape(-1, 5)
        firsts = (ends - counts).tolist()
        self._free: list[int] = [
            start + index
            for start, view in zip(firsts, views, strict=True)
            for index in view.servos.free
        ]
        self._motor_offsets = table[:, 0].astype(np.intp)
        self._motors = table.T[1:]

    def _read_cores(self, state: Floats) -> None:
        """Read the imus at cores' centres from the free joints' states."""
        if not self._cores:
            return
        w, x, y, z = state[self._orientations].T
        motions = state[self._motions]
        velocities = motions[:, :3]
        change = (velocities - self._velocities) / self._tick_s
        ax, ay, az = (change - self._gravity).T
        self._velocities = velocities
        cells, places = self.readings.reshape(-1), self._places
        acceleration = into_frame((w, x, y, z), (ax, ay, az))
        for axis in range(3):
            cells[places + axis] = acceleration[axis]
            cells[places + 3 + axis] = motions[:, 3 + axis]
        for sensors, (vx, vy, vz) in zip(self._cores, velocities.tolist(), strict=True):
            sensors.velocities[0] = (vx, vy, vz)
