"""What a robot feels and what its motors are told.

Readings are functions of the engine's current (qpos, qvel) and of the contacts of
the last step, never of its ``sensordata``, which is empty after a restore. A robot
is found in a model by the prefix of its names, so that many can share one.
"""

from itertools import chain
from typing import TypeVar, cast

import mujoco
import numpy as np

from schema.errors import ExperimentError
from schema.parts import BodySpace
from schema.robot.results import Floats
from schema.robot.robot import Robot

LOWEST_OUTPUT = 1e-5
HIGHEST_OUTPUT = 0.99999
"""Outputs are clipped to these before they become target angles."""

_Velocity = tuple[float, float, float]
_Number = TypeVar("_Number", float, Floats)
_GEOM = mujoco.mjtObj.mjOBJ_GEOM
_SITE = mujoco.mjtObj.mjOBJ_SITE
_JOINT = mujoco.mjtObj.mjOBJ_JOINT
_ACTUATOR = mujoco.mjtObj.mjOBJ_ACTUATOR


class Senses:
    """The sensors of one robot in a model, in the order of its network's inputs.

    Acceleration is what an ideal sensor averages between two readings: change of
    velocity over time in the present sensor frame, less gravity; at rest it reads
    +9.81 against it. A pad reads 1 while it touches anything but its own segment and
    those joined to it.

    Attributes:
        readings: (1, I) the last values; unused inputs stay 0.
        velocities: of each imu at the last reading, world frame [m/s]; part of
            what a snapshot must keep.
        lights: (geom, place in the readings) of each light sensor.
        pads: the same of each touch sensor.
        core_imu: place in the readings of the imu at the core's centre, or -1.
    """

    def __init__(
        self,
        robot: Robot,
        space: BodySpace,
        model: mujoco.MjModel,
        *,
        width: int,
        prefix: str = "",
        has_light: bool = False,
    ) -> None:
        """Find the sensors.

        Args:
            robot: the robot.
            space: its part types.
            model: a compiled model that holds it.
            width: number I of readings, at least the robot's inputs.
            prefix: of the robot's names in the model.
            has_light: somebody else fills in what light sensors read.

        Raises:
            ExperimentError: a light sensor, and this world has no light.
        """
        self.readings: Floats = np.zeros((1, width))
        self.velocities: list[_Velocity] = []
        self._row = self.readings[0]
        self._cells = _cells(self._row)
        self._data: mujoco.MjData | None = None
        self.pads: list[tuple[int, int]] = []
        self.core_imu = -1
        self._imus: list[tuple[int, int]] = []
        self.lights: list[tuple[int, int]] = []
        start = free_joint(model, prefix)
        self._qpos = int(model.jnt_qposadr[start])
        self._qvel = int(model.jnt_dofadr[start])
        root = int(model.jnt_bodyid[start])
        gx, gy, gz = model.opt.gravity.tolist()
        self._gravity = (gx, gy, gz)
        place = 0
        for index, part in enumerate(robot.parts):
            for sensor in space[part.kind].sensors:
                if sensor.kind == "light" and not has_light:
                    raise ExperimentError(
                        f"body.parts[{index}]: {part.kind}: no light in this world"
                    )
                if sensor.kind == "light":
                    name = f"{prefix}{index}/{sensor.box}"
                    self.lights.append((find(model, _GEOM, name), place))
                elif sensor.kind == "touch":
                    name = f"{prefix}{index}/{sensor.box}"
                    self.pads.append((find(model, _GEOM, name), place))
                else:
                    site = find(model, _SITE, f"{prefix}{index}/imu")
                    self._add_imu(model, site, root, place)
                place += sensor.inputs

    def _add_imu(self, model: mujoco.MjModel, site: int, root: int, place: int) -> None:
        at_origin = (
            int(model.site_bodyid[site]) == root
            and not model.site_pos[site].any()
            and model.site_quat[site].tolist() == [1.0, 0.0, 0.0, 0.0]
        )
        if at_origin and self.core_imu < 0:
            self.core_imu = place
        else:
            self._imus.append((site, place))

    @property
    def is_simple(self) -> bool:
        """Whether the free joint's state and contacts tell all it feels."""
        return self.core_imu >= 0 and not self._imus

    def show(self, readings: Floats) -> None:
        """Have the readings stand elsewhere from now on, (1, I)."""
        readings[:] = self.readings
        self.readings, self._row = readings, readings[0]
        self._cells = _cells(self._row)

    def start(self, model: mujoco.MjModel, data: mujoco.MjData) -> Floats:
        """Return the first readings: no motion before, so no acceleration."""
        mujoco.mj_forward(model, data)
        self.velocities = [_velocity_of(data.qvel[self._qvel : self._qvel + 3])] + [
            _velocity_of(_site_motion(model, data, site)[3:]) for site, _ in self._imus
        ]
        return self.read(model, data, 1.0)

    def read(
        self, model: mujoco.MjModel, data: mujoco.MjData, interval_s: float
    ) -> Floats:
        """Read all sensors.

        Args:
            model: the model.
            data: its state, just stepped.
            interval_s: since the last reading [s].

        Returns:
            ``readings``, new values.
        """
        if self.core_imu >= 0:
            if data is not self._data:
                self._bind(data)
            self._read_core(interval_s)
        if self._imus:
            self._read_sites(model, data, interval_s)
        if self.pads:
            # No ravel: a copy of rows that lie apart costs more than the chain.
            touching = set(chain.from_iterable(data.contact.geom.tolist()))
            for geom, place in self.pads:
                self._cells[place] = float(geom in touching)
        return self.readings

    def _bind(self, data: mujoco.MjData) -> None:
        """Look at another state from now on."""
        self._data = data
        self._pose = _cells(data.qpos[self._qpos + 3 : self._qpos + 7])
        self._motion = _cells(data.qvel[self._qvel : self._qvel + 6])

    def _read_core(self, interval_s: float) -> None:
        """Read the imu of the core straight from the free joint's state.

        Plain floats by memory views: at one robot they take a third of the time
        of arrays of three.
        """
        w, x, y, z = self._pose.tolist()
        vx, vy, vz, gx, gy, gz = self._motion.tolist()
        ux, uy, uz = self.velocities[0]
        fx, fy, fz = self._gravity
        self.velocities[0] = (vx, vy, vz)
        ax = (vx - ux) / interval_s - fx
        ay = (vy - uy) / interval_s - fy
        az = (vz - uz) / interval_s - fz
        row, place = self._cells, self.core_imu
        felt = into_frame((w, x, y, z), (ax, ay, az))
        row[place], row[place + 1], row[place + 2] = felt
        row[place + 3], row[place + 4], row[place + 5] = gx, gy, gz

    def _read_sites(
        self, model: mujoco.MjModel, data: mujoco.MjData, interval_s: float
    ) -> None:
        """Read imus elsewhere than at the core's centre."""
        mujoco.mj_kinematics(model, data)
        mujoco.mj_comPos(model, data)
        mujoco.mj_comVel(model, data)
        for number, (site, place) in enumerate(self._imus, start=1):
            motion = _site_motion(model, data, site)
            rotation = data.site_xmat[site].reshape(3, 3)
            change = np.subtract(motion[3:], self.velocities[number]) / interval_s
            change -= self._gravity
            self.velocities[number] = _velocity_of(motion[3:])
            self._row[place : place + 3] = change @ rotation
            self._row[place + 3 : place + 6] = motion[:3] @ rotation


class Servos:
    """The motors of one robot: network outputs to commanded joint velocities.

    Attributes:
        slots: indices of its actuators in the model, contiguous, in part order.
        motors: of each, address of its joint's angle in the model, lowest target,
            span of the targets, gain and greatest velocity.
    """

    def __init__(
        self, robot: Robot, space: BodySpace, model: mujoco.MjModel, *, prefix: str = ""
    ) -> None:
        """Find the motors.

        Args:
            robot: the robot.
            space: its part types.
            model: a compiled model that holds it.
            prefix: of the robot's names in the model.
        """
        self.motors: list[tuple[int, float, float, float, float]] = []
        actuators: list[int] = []
        for index, part in enumerate(robot.parts):
            motor = space[part.kind].motor
            if motor is None:
                continue
            name = f"{prefix}joint{index}"
            actuators.append(find(model, _ACTUATOR, name))
            joint = find(model, _JOINT, name)
            low, high = model.jnt_range[joint].tolist()
            self.motors.append(
                (
                    int(model.jnt_qposadr[joint]),
                    low,
                    high - low,
                    motor.gain,
                    motor.max_velocity,
                )
            )
        first = actuators[0] if actuators else 0
        self.slots = slice(first, first + len(actuators))
        self._data: mujoco.MjData | None = None
        assert actuators == list(range(first, first + len(actuators)))

    def drive(self, data: mujoco.MjData, outputs: Floats) -> None:
        """Command each joint towards its target, until the next tick.

        Args:
            data: the state; its ``ctrl`` is written [rad/s].
            outputs: (O,) of the network, unclipped; O may exceed the motors.
        """
        if data is not self._data:
            self._data = data
            self._angles = _cells(data.qpos)
            self._commands = _cells(data.ctrl[self.slots])
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
            command = gain * (low + share * span - angles[address])
            if command < -fastest:
                command = -fastest
            elif command > fastest:
                command = fastest
            commands[index] = command


def into_frame(
    turn: tuple[_Number, _Number, _Number, _Number],
    vector: tuple[_Number, _Number, _Number],
) -> tuple[_Number, _Number, _Number]:
    """Return vectors of the world in the frames of turned bodies.

    Args:
        turn: w, x, y, z of unit quaternions, body into world; each a number or (N,).
        vector: along the world's axes, likewise.
    """
    w, x, y, z = turn
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


def free_joint(model: mujoco.MjModel, prefix: str = "") -> int:
    """Return the index of a robot's free joint."""
    return find(model, _JOINT, f"{prefix}free")


def find(model: mujoco.MjModel, kind: mujoco.mjtObj, name: str) -> int:
    """Return the index of a named element of a model.

    Raises:
        KeyError: the model has none of that name.
    """
    index = int(mujoco.mj_name2id(model, kind, name))
    if index < 0:
        raise KeyError(name)
    return index


def _site_motion(model: mujoco.MjModel, data: mujoco.MjData, site: int) -> Floats:
    """Return a site's angular and linear velocity, (6,), world frame."""
    motion = np.empty(6)
    mujoco.mj_objectVelocity(model, data, _SITE, site, motion, 0)
    return motion


def _velocity_of(vector: Floats) -> _Velocity:
    return cast("_Velocity", tuple(vector.tolist()))


def _cells(array: Floats) -> "memoryview[float]":
    """Return a view of an array (N,) that is faster than it, number by number."""
    return cast("memoryview[float]", array.data)
