"""Own sensors of one robot: sensors of plug-ins, which read a view of their part."""

from collections.abc import Container, Sequence
from dataclasses import dataclass

import mujoco
import numpy as np

from schema.errors import SensorFailed, cut, error_text
from schema.parts import OwnSensor, Vector
from schema.plugins.protocols import SensorView
from schema.plugins.sensor_checks import ray_problem, values_of
from schema.robot.trace import Floats
from worker.robot.light import State, ray_share
from worker.robot.placed import PlacedRobot


@dataclass(frozen=True, slots=True)
class Surroundings:
    """What a robot's light sensors and own sensors see beside the robot.

    Attributes:
        age_s: simulated time since the robot's birth [s].
        touched: geoms of its model that were in contact in the last step.
        states: other models of the same world, which rays meet, too.
        others: (N, 3) centres of the cores of all other robots, world frame [m].
        light: position of the light, world frame [m].
    """

    age_s: float
    touched: Container[int]
    states: Sequence[State] = ()
    others: Floats | None = None
    light: Vector | None = None


class PartView:
    """View of a part in a model; a ``SensorView``.

    Attributes:
        around: what is around it at the present tick.
    """

    def __init__(self, placed: PlacedRobot, index: int) -> None:
        """Find a part of a robot in a model, by its index."""
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
        self,
        box: str,
        direction: Vector,
        reach: float,
        start: Vector = (0.0, 0.0, 0.0),
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
        self,
        sensors: Sequence[tuple[int, str, OwnSensor, int]],
        placed: PlacedRobot,
    ) -> None:
        """Find their parts.

        Args:
            sensors: of each, index and type of its part, the sensor, and its first
                index in the readings.
            placed: the robot in a model.
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
