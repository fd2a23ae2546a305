"""Sensors and motors of one robot in a model.

Readings are functions of the engine's current (qpos, qvel) and of the contacts of
the last step, never of its ``sensordata``, which is empty after a restore. Motors turn
the outputs of a brain into commanded joint velocities. A robot is found in a model by
the prefix of its names, so that several can share a model.
"""

from collections.abc import Container
from itertools import chain
from typing import cast

import mujoco
import numpy as np

from schema.errors import ExperimentError
from schema.parts import Sensor, Vector
from schema.robot.trace import Floats
from schema.robot.trees import Integers
from worker.robot.own_sensors import OwnSensors, Surroundings, brightness
from worker.robot.placed import PlacedRobot, contact_reader

LOWEST_OUTPUT = 1e-5
HIGHEST_OUTPUT = 0.99999
"""Outputs are clipped to these before they become target angles."""


class Sensors:
    """Sensors of one robot in a model, in the order of its network's inputs.

    The acceleration is the mean between two readings: change of velocity over time
    in the present sensor frame, less gravity; at rest it is +9.81 upwards. A touch
    sensor reads 1 while it is in contact with anything but its own segment and those
    joined to it.

    Attributes:
        readings: (1, I) the last values; unused inputs stay 0.
        velocities: of each imu at the last reading, world frame [m/s]; part of a
            snapshot.
        lights: (geom, index in the readings) of each light sensor.
        pads: the same of each touch sensor.
        core_imu: index in the readings of the imu at the core's centre, or -1.
        own: sensors of plug-ins; None if there are none.
    """

    def __init__(
        self, placed: PlacedRobot, *, width: int, has_light: bool = False
    ) -> None:
        """Find the sensors.

        Raises:
            ExperimentError: a light sensor in a world without light.
        """
        model, data, prefix = placed.model, placed.data, placed.prefix
        self._model, self._data = model, data
        self._contacts = contact_reader(model, data)
        self.velocities: list[Vector] = []
        self.pads: list[tuple[int, int]] = []
        self.core_imu = -1
        self._imus: list[tuple[int, int]] = []
        self.lights: list[tuple[int, int]] = []
        qpos, qvel = placed.joints.start, placed.dofs.start
        self._orientation = _cells(data.qpos[qpos + 3 : qpos + 7])
        self._motion = _cells(data.qvel[qvel : qvel + 6])
        # A view of the model's, which may change.
        self._gravity = _cells(model.opt.gravity)
        place, own = 0, []
        for index, part in enumerate(placed.robot.parts):
            for sensor in placed.space[part.kind].sensors:
                if not isinstance(sensor, Sensor):
                    own.append((index, part.kind, sensor, place))
                    place += sensor.inputs
                    continue
                if sensor.kind == "light" and not has_light:
                    raise ExperimentError(
                        f"body.parts[{index}]: {part.kind}: no light in this world"
                    )
                if sensor.kind == "imu":
                    site = model.site(f"{prefix}{index}/imu").id
                    self._add_imu(site, placed.root, place)
                else:
                    geom = model.geom(f"{prefix}{index}/{sensor.box}").id
                    kind = self.lights if sensor.kind == "light" else self.pads
                    kind.append((geom, place))
                place += sensor.inputs
        self.own = OwnSensors(own, placed) if own else None
        self.readings: Floats = np.zeros((1, width))
        self.write_to(self.readings)

    def _add_imu(self, site: int, root: int, place: int) -> None:
        model = self._model
        is_at_centre = (
            int(model.site_bodyid[site]) == root
            and not model.site_pos[site].any()
            and model.site_quat[site].tolist() == [1.0, 0.0, 0.0, 0.0]
        )
        if is_at_centre and self.core_imu < 0:
            self.core_imu = place
        else:
            self._imus.append((site, place))

    def write_to(self, readings: Floats) -> None:
        """Move the readings to another array, (1, I), and write there from now on."""
        readings[:] = self.readings
        self.readings, self._row = readings, readings[0]
        self._cells = _cells(self._row)

    def start(self) -> Floats:
        """Return the first readings: no motion before, so no acceleration."""
        mujoco.mj_forward(self._model, self._data)
        vx, vy, vz, *_ = self._motion.tolist()
        self.velocities = [(vx, vy, vz)] + [
            _velocity_of(self._site_motion(site)[3:]) for site, _ in self._imus
        ]
        return self.read(1.0)

    def read(self, interval_s: float, touched: Container[int] | None = None) -> Floats:
        """Read all sensors but those that ``look`` reads; return ``readings``.

        The geoms that were in contact in the last step may be known.
        """
        if self.core_imu >= 0:
            self._read_core(interval_s)
        if self._imus:
            self._read_sites(interval_s)
        if self.pads:
            # No ravel: a copy of rows that lie apart costs more than the chain.
            touching = self.touching() if touched is None else touched
            for geom, place in self.pads:
                self._cells[place] = float(geom in touching)
        return self.readings

    @property
    def looks(self) -> bool:
        """Whether a sensor needs ``look``."""
        return bool(self.lights) or self.own is not None

    def look(self, around: Surroundings) -> None:
        """Read light sensors and own ones, given the present frames of all bodies."""
        for geom, place in self.lights:
            state = self._model, self._data
            lights = (around.light, *around.patch_lights)
            seen = (
                brightness(light, state, geom, around.states)
                for light in lights
                if light is not None
            )
            self._cells[place] = min(1.0, sum(seen))
        if self.own is not None:
            self.own.read(self._row, around)

    def touching(self) -> set[int]:
        """Return the geoms in contact in the last step."""
        return set(chain.from_iterable(self._contacts()))

    def _read_core(self, interval_s: float) -> None:
        """Read the imu of the core from the free joint's state.

        For one robot, plain floats from memory views take a third of the time of
        arrays of three.
        """
        w, x, y, z = self._orientation.tolist()
        vx, vy, vz, gx, gy, gz = self._motion.tolist()
        ux, uy, uz = self.velocities[0]
        fx, fy, fz = self._gravity.tolist()
        self.velocities[0] = (vx, vy, vz)
        ax = (vx - ux) / interval_s - fx
        ay = (vy - uy) / interval_s - fy
        az = (vz - uz) / interval_s - fz
        row, place = self._cells, self.core_imu
        acceleration = into_frame((w, x, y, z), (ax, ay, az))
        row[place], row[place + 1], row[place + 2] = acceleration
        row[place + 3], row[place + 4], row[place + 5] = gx, gy, gz

    def _read_sites(self, interval_s: float) -> None:
        """Read imus at other places than the core's centre."""
        model, data = self._model, self._data
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)
        for number, (site, place) in enumerate(self._imus, start=1):
            motion = self._site_motion(site)
            rotation = data.site_xmat[site].reshape(3, 3)
            change = np.subtract(motion[3:], self.velocities[number]) / interval_s
            change -= self._gravity.tolist()
            self.velocities[number] = _velocity_of(motion[3:])
            self._row[place : place + 3] = change @ rotation
            self._row[place + 3 : place + 6] = motion[:3] @ rotation

    def _site_motion(self, site: int) -> Floats:
        """Return a site's angular and linear velocity, (6,), world frame."""
        motion = np.empty(6)
        kind = mujoco.mjtObj.mjOBJ_SITE
        mujoco.mj_objectVelocity(self._model, self._data, kind, site, motion, 0)
        return motion


class Servos:
    """Velocity servos of one robot in a model, in part order.

    Attributes:
        actuators: indices of its actuators in the model, contiguous.
        motors: of each, the address of its joint's angle in the model, lowest target,
            range of the targets, gain and greatest velocity. Of a motor that controls
            the velocity, targets are velocities, and the address is -1.
    """

    def __init__(self, placed: PlacedRobot) -> None:
        model, data = placed.model, placed.data
        self.motors: list[tuple[int, float, float, float, float]] = []
        self._limits = model.actuator_forcerange
        torques: list[float] = []
        found: list[int] = []
        for index, part in enumerate(placed.robot.parts):
            motor = placed.space[part.kind].motor
            if motor is None:
                continue
            name = f"{placed.prefix}joint{index}"
            found.append(model.actuator(name).id)
            torques.append(motor.max_torque)
            joint = model.joint(name).id
            low, high = model.jnt_range[joint].tolist()
            address = int(model.jnt_qposadr[joint])
            limits = (low, high - low, motor.gain, motor.max_velocity)
            if motor.control == "velocity":
                fastest = motor.max_velocity
                address, limits = -1, (-fastest, 2.0 * fastest, 1.0, fastest)
            self.motors.append((address, *limits))
        self._model, self._first_dof = model, placed.dofs.start
        first = found[0] if found else 0
        self.actuators = slice(first, first + len(found))
        self._torques = np.array(torques)
        assert found == list(range(first, first + len(found)))
        # Memory views are faster than arrays, number by number.
        self._angles = data.qpos.data
        self._commands = data.ctrl[self.actuators].data

    def torques(self) -> tuple[Integers, Floats, Floats]:
        """Return what the torque of each of its A motors depends on.

        They are (A,): velocities' places among those of the robot; torque per error of
        velocity [N m s/rad]; greatest torque [N m]. Of sliders forces.
        """
        model, own = self._model, self.actuators
        dofs = model.jnt_dofadr[model.actuator_trnid[own, 0]].astype(np.int64)
        dofs -= self._first_dof
        return dofs, model.actuator_gainprm[own, 0], model.actuator_forcerange[own, 1]

    def limit(self, factor: float) -> None:
        """Set the greatest torques of the motors, by the factor of ``simulation``."""
        most = self._torques * factor
        self._limits[self.actuators] = np.column_stack((-most, most))

    def drive(self, outputs: Floats) -> None:
        """Command each joint towards its target, until the next tick.

        Writes the state's ``ctrl`` [rad/s], of sliders [m/s]. The outputs of the
        network are (O,), unclipped; O may exceed the motors.
        """
        angles, commands = self._angles, self._commands
        for index, ((address, low, span, gain, fastest), output) in enumerate(
            zip(self.motors, outputs.tolist(), strict=False)
        ):
            # Bounds by comparison: twice as fast as min and max.
            share = output
            if share < LOWEST_OUTPUT:
                share = LOWEST_OUTPUT
            elif share > HIGHEST_OUTPUT:
                share = HIGHEST_OUTPUT
            command = low + share * span
            if address >= 0:
                command = gain * (command - angles[address])
            if command < -fastest:
                command = -fastest
            elif command > fastest:
                command = fastest
            commands[index] = command


def into_frame(
    orientation: tuple[float, float, float, float], vector: Vector
) -> Vector:
    """Return a vector of the world in the frame of a rotated body.

    The orientation is w, x, y, z of a unit quaternion, body to world.
    """
    w, x, y, z = orientation
    ax, ay, az = vector
    # The rows are the columns of the body's rotation.
    return (
        (1 - 2 * (y * y + z * z)) * ax
        + 2 * (x * y + w * z) * ay
        + 2 * (x * z - w * y) * az,
        2 * (x * y - w * z) * ax
        + (1 - 2 * (x * x + z * z)) * ay
        + 2 * (y * z + w * x) * az,
        2 * (x * z + w * y) * ax
        + 2 * (y * z - w * x) * ay
        + (1 - 2 * (x * x + y * y)) * az,
    )


def _velocity_of(vector: Floats) -> Vector:
    return cast("Vector", tuple(vector.tolist()))


def _cells(array: Floats) -> "memoryview[float]":
    """Return a view of an array (N,) that is faster than it, number by number."""
    return cast("memoryview[float]", array.data)
