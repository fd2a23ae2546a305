"""What all robots of an arena feel, and what all their motors are told, in batches.

The same arithmetic, number by number, as ``worker.robot.sensors`` does for one robot
(tests/worker/test_nerves.py); a robot with sensors that only the engine can tell,
other than pads, is felt alone.
"""

import numpy as np

from schema.experiment.document import Simulation
from schema.parts import Vector
from schema.robot.results import Floats
from worker.clusters.bounds import Indices
from worker.clusters.columns import Layout, RobotRows
from worker.clusters.engine_view import EngineView
from worker.robot.controller import Widths
from worker.robot.sensors import HIGHEST_OUTPUT, LOWEST_OUTPUT, into_frame


class BatchedIO:
    """Readings of all robots, by birth, and the way to their motors.

    Attributes:
        readings: (R, I) what all last felt; each robot's seat looks at its row.
    """

    def __init__(self, width: Widths, simulation: Simulation, gravity: Vector) -> None:
        """Start with nobody.

        Args:
            width: of every network.
            simulation: its clocks.
            gravity: of the world [m/s2].
        """
        self._width = width
        self._tick_s = simulation.brain_steps * simulation.timestep_s
        self._gravity = np.array(gravity)
        self.readings = np.zeros((0, width.inputs))
        self._layout = Layout((), RobotRows(()))
        self._views: list[EngineView] = []
        self._gather(self._layout.robot_rows)

    def settle(self, layout: Layout) -> None:
        """Go on with robots that may sit elsewhere, or be others, since last time.

        Args:
            layout: where they are.
        """
        if layout is self._layout:
            return
        if layout.robot_rows is not self._layout.robot_rows:
            self._gather(layout.robot_rows)
        self._layout = layout
        views = [one.view for one in layout.robot_rows.everybody]
        for row, view in enumerate(views):
            if view is not self._views[row]:
                view.senses.show(self.readings[row : row + 1])
        self._views = views
        self._controls = [view.ctrl for view in views]
        self._alone = [views[row] for row in self._others]
        self._cores = [views[row].senses for row in self._simple.tolist()]
        self._turns = layout.roots[self._simple, 3:]
        self._motions = layout.motions[self._simple]
        self._angles = layout.starts[self._motor_rows] + self._motor_offsets
        homes = layout.homes.tolist()
        self._pads = [
            (row, views[row].senses.pads, layout.clusters[homes[row]])
            for row in self._padded
        ]

    def feel(self, state: Floats) -> None:
        """Read all sensors but those of light.

        Args:
            state: of all clusters in a row, as the engine has it just now.
        """
        self._feel_cores(state)
        for view in self._alone:
            view.feel(self._tick_s)
        for row, pads, cluster in self._pads:
            for geom, place in pads:
                self.readings[row, place] = geom in cluster.touched

    def drive(self, state: Floats, outputs: Floats) -> None:
        """Command all motors, until the next tick.

        Args:
            state: of all clusters in a row.
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
        start = 0
        for controls in self._controls:
            end = start + len(controls)
            controls[:] = command[start:end]
            start = end

    def _gather(self, robot_rows: RobotRows) -> None:
        """Take over robots, some of whom may be new."""
        views = [one.view for one in robot_rows.everybody]
        readings = [view.senses.readings for view in views]
        self.readings = np.concatenate([np.zeros((0, self._width.inputs)), *readings])
        for row, view in enumerate(views):
            view.senses.show(self.readings[row : row + 1])
        self._views = views
        simple = [row for row, view in enumerate(views) if view.senses.is_simple]
        self._others = sorted(set(range(len(views))).difference(simple))
        self._padded = [row for row in simple if views[row].senses.pads]
        self._simple = np.array(simple, dtype=np.intp)
        before = [views[row].senses.velocities[0] for row in simple]
        self._velocities: Floats = np.array(before).reshape(-1, 3)
        cores = [views[row].senses.core_imu for row in simple]
        self._places = self._simple * self._width.inputs + np.array(cores, np.intp)
        counts = np.array([len(view.ctrl) for view in views], dtype=np.intp)
        self._motor_rows = np.repeat(np.arange(len(views)), counts)
        ends = np.cumsum(counts)
        first = np.repeat(ends - counts, counts)
        self._motor_outputs: Indices = np.arange(len(first)) - first
        motors = np.concatenate([np.zeros((0, 5)), *(view.motors for view in views)])
        self._motor_offsets = motors[:, 0].astype(np.intp)
        self._motors = motors.T[1:]

    def _feel_cores(self, state: Floats) -> None:
        """Read the imus at cores' centres from the free joints' states."""
        if not self._cores:
            return
        w, x, y, z = state[self._turns].T
        motions = state[self._motions]
        velocities = motions[:, :3]
        change = (velocities - self._velocities) / self._tick_s
        ax, ay, az = (change - self._gravity).T
        self._velocities = velocities
        cells, places = self.readings.reshape(-1), self._places
        felt = into_frame((w, x, y, z), (ax, ay, az))
        for axis in range(3):
            cells[places + axis] = felt[axis]
        for axis in range(3):
            cells[places + 3 + axis] = motions[:, 3 + axis]
        for senses, (vx, vy, vz) in zip(self._cores, velocities.tolist(), strict=True):
            senses.velocities[0] = (vx, vy, vz)
