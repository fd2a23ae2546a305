"""Sensors that see what is around a robot: light sensors, and those of plug-ins.

The light is a point. A light sensor faces along its part's x axis from the face of its
box and reads cos(theta) min(1, (1 m / d)^2): theta is the angle between its axis
and the direction of the light, d the distance of the light. It reads 0 if the light
is behind it or hidden by a robot, a wall or scenery. Source: own; the fall with
distance is that of the original's PointIntensity sensor. No camera is used, so
births and deaths do not disturb the readings.

A sensor of a plug-in reads a view of its part.
"""

from collections.abc import Container, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from schema.errors import SensorFailed, cut, error_text
from schema.parts import OwnSensor, Vector
from schema.plugins.protocols import SensorView
from schema.plugins.sensor_checks import ray_problem, values_of
from schema.robot.trace import Floats
from worker.robot.placed import PlacedRobot

State = tuple[mujoco.MjModel, mujoco.MjData]
"""Model and data of some robots."""
FULL_WITHIN_M = 1.0
"""Distance within which the light has full brightness."""
_OUTSIDE_M = 1e-6
"""Distance from a sensor's face at which its ray starts."""


@dataclass(frozen=True, slots=True)
class Surroundings:
    """What a robot's light sensors and own sensors see beside the robot.

    Attributes:
        age_s: simulated time since the robot's birth [s].
        touched: geoms of its model that were in contact in the last step.
        states: other models of the same world, which rays meet, too.
        others: (N, 3) centres of the cores of all other robots, world frame [m].
        light: position of the light, world frame [m].
        patch_lights: positions of further lights, which own sensors do not see [m].
    """

    age_s: float
    touched: Container[int]
    states: Sequence[State] = ()
    others: Floats | None = None
    light: Vector | None = None
    patch_lights: tuple[Vector, ...] = ()


class PartView:
    """View of a part in a model, with what is around it now; a ``SensorView``."""

    def __init__(self, placed: PlacedRobot, index: int) -> None:
        model, self._data = placed.model, placed.data
        self._state = model, self._data
        self.around = Surroundings(0.0, ())
        start = f"{placed.prefix}{index}/"
        names = {number: model.geom(number).name for number in range(*placed.geoms)}
        self._geoms = {
            name.removeprefix(start): number
            for number, name in names.items()
            if name.startswith(start)
        }
        kind = mujoco.mjtObj.mjOBJ_JOINT
        joint = mujoco.mj_name2id(model, kind, f"{placed.prefix}joint{index}")
        self._joint = joint if joint >= 0 else None

    @property
    def age_s(self) -> float:
        """Simulated time since the robot's birth [s]."""
        return self.around.age_s

    @property
    def joint_angle(self) -> float:
        """Angle [rad] or displacement [m] of the part's joint; 0 without a joint."""
        if self._joint is None:
            return 0.0
        return float(self._data.qpos[self._state[0].jnt_qposadr[self._joint]])

    @property
    def joint_speed(self) -> float:
        """Velocity of the part's joint [rad/s] or [m/s]; 0 without a joint."""
        if self._joint is None:
            return 0.0
        return float(self._data.qvel[self._state[0].jnt_dofadr[self._joint]])

    @property
    def light(self) -> Vector | None:
        """Position of the light, world frame [m]."""
        return self.around.light

    @property
    def others(self) -> Floats:
        """Centres of the cores of all other robots, (N, 3), world frame [m]."""
        others = self.around.others
        return np.zeros((0, 3)) if others is None else others.copy()

    def position(self, box: str) -> Floats:
        """Return the centre of a box, (3,), world frame [m]."""
        return np.array(self._data.geom_xpos[self._geoms[box]])

    def rotation(self, box: str) -> Floats:
        """Return the rotation from a box's frame to the world frame, (3, 3)."""
        return np.array(self._data.geom_xmat[self._geoms[box]].reshape(3, 3))

    def touches(self, box: str) -> bool:
        """Return whether a box was in contact in the last step."""
        return self._geoms[box] in self.around.touched

    def distance(
        self, box: str, direction: Vector, reach: float, start: Vector = (0.0, 0.0, 0.0)
    ) -> float:
        """Return how far a ray gets [m]; see ``SensorView``."""
        ray_problem(direction, reach, start)
        rotation = self.rotation(box)
        place = self.position(box) + rotation @ start
        way = rotation @ direction
        own = int(self._state[0].geom_bodyid[self._geoms[box]])
        nearest = ray_share(self._state, place, way, own)
        for state in self.around.states:
            nearest = min(nearest, ray_share(state, place, way))
        return min(nearest, reach)


class OwnSensors:
    """Own sensors of one robot in a model."""

    def __init__(
        self, sensors: Sequence[tuple[int, str, OwnSensor, int]], placed: PlacedRobot
    ) -> None:
        """Find the parts of the sensors.

        Of each: index and type of its part, the sensor, its first index in readings.
        """
        # Its code may change the number of inputs of a sensor; the brain has these.
        self._sensors = [
            (
                PartView(placed, index),
                sensor,
                slice(place, place + sensor.inputs),
                f"part {index} ({kind})",
            )
            for index, kind, sensor, place in sensors
        ]

    def read(self, readings: Floats, around: Surroundings) -> None:
        """Read all of them; frames of the bodies must be those of the state.

        Raises:
            SensorFailed: a sensor raised, or gave a wrong number of values or one
                that is not finite.
        """
        for view, sensor, cells, where in self._sensors:
            view.around = around
            seen: SensorView = view
            try:
                values = values_of(cells.stop - cells.start, sensor.read(seen))
            except Exception as error:
                story = cut(error_text(error))
                raise SensorFailed(
                    f"sensor {type(sensor).__name__} of {where}: {story}"
                ) from error
            readings[cells] = values


def brightness(
    light: Vector, state: State, geom: int, others: Sequence[State]
) -> float:
    """Return the reading of the light sensor in a box of a model.

    The light has a position, world frame [m]; frames are those of the state. Geoms of
    other models of the same world may hide it, too.
    """
    model, data = state
    outward = data.geom_xmat[geom].reshape(3, 3)[:, 0]
    face = float(model.geom_size[geom][0]) + _OUTSIDE_M
    start = data.geom_xpos[geom] + face * outward
    ray = np.array(light) - start
    distance = float(np.sqrt(ray @ ray))
    if distance == 0.0:
        return 1.0
    slope = float(ray @ outward) / distance
    ends = (ray_share(world, start, ray) for world in (state, *others))
    if slope <= 0.0 or any(share < 1.0 for share in ends):
        return 0.0
    return slope * min(1.0, (FULL_WITHIN_M / distance) ** 2)


def ray_share(state: State, start: Floats, ray: Floats, but: int = -1) -> float:
    """Return where a ray meets the first geom, in its lengths; infinite if it does not.

    Start (3,), and direction with length (3,), are in the world frame [m]; frames are
    those of the state. The ray passes the geoms of a body; -1 is none.
    """
    hit = np.zeros(1, dtype=np.int32)
    share = mujoco.mj_ray(*state, start, ray, None, 1, but, hit)
    return share if hit[0] >= 0 else np.inf
