"""One robot's place in a cluster: live views of its part of the engine's state."""

from dataclasses import dataclass

import mujoco
import numpy as np

from schema.parts import BodySpace
from schema.robot.results import Floats
from schema.robot.robot import Robot
from worker.robot.controller import Widths
from worker.robot.sensors import Senses, Servos, find, free_joint


@dataclass(frozen=True, slots=True)
class Rules:
    """What seats of one arena have in common.

    Attributes:
        types: that robots' parts may have.
        width: of every network.
        has_light: somebody fills in what light sensors read.
    """

    types: BodySpace
    width: Widths
    has_light: bool


class EngineView:
    """One robot's place in a cluster: live views, its senses and its motors.

    Attributes:
        model, data: of the cluster.
        qpos, qvel, ctrl: its part of the state.
        xpos, xmat: frames of its bodies as of the last step, (N, 3) and (N, 9).
        joints, dofs: where its part of qpos and of qvel starts in the cluster's.
        bodies: which of the cluster's are its own.
        offsets: where its part of each of ``Cluster.live`` starts.
        geoms: first and last + 1 of its geoms.
        motors: (M, 5) as ``Servos.motors``, addresses counted from its first angle.
    """

    def __init__(
        self,
        robot: Robot,
        solo: mujoco.MjModel,
        rules: Rules,
        place: tuple[mujoco.MjModel, mujoco.MjData, str],
    ) -> None:
        """Find a robot in a cluster by the prefix of its names.

        Args:
            robot: the robot.
            solo: the model in which it is alone: tells its sizes.
            rules: of the arena.
            place: the cluster's model and data, and the prefix.
        """
        model, data, prefix = place
        self.model, self.data = model, data
        free = free_joint(model, prefix)
        first = find(model, mujoco.mjtObj.mjOBJ_BODY, f"{prefix}root")
        root = int(solo.jnt_bodyid[0])
        self.bodies = slice(first, first + solo.nbody - root)
        self.joints = int(model.jnt_qposadr[free])
        self.dofs = int(model.jnt_dofadr[free])
        self.offsets = (self.joints, self.dofs, 3 * first, 9 * first)
        geom = int(model.body_geomadr[first])
        self.geoms = (geom, geom + solo.ngeom - int(solo.body_geomadr[root]))
        self.senses = Senses(
            robot,
            rules.types,
            model,
            width=rules.width.inputs,
            prefix=prefix,
            has_light=rules.has_light,
        )
        self.servos = Servos(robot, rules.types, model, prefix=prefix)
        self.motors = np.array(self.servos.motors, dtype=np.float64).reshape(-1, 5)
        self.motors[:, 0] -= self.joints
        self.qpos: Floats = data.qpos[self.joints : self.joints + solo.nq]
        self.qvel: Floats = data.qvel[self.dofs : self.dofs + solo.nv]
        self.ctrl: Floats = data.ctrl[self.servos.slots]
        self.xpos: Floats = data.xpos[self.bodies]
        self.xmat: Floats = data.xmat[self.bodies]

    def start(self) -> None:
        """Feel for the first time."""
        self.senses.start(self.model, self.data)

    def feel(self, interval_s: float) -> None:
        """Read all sensors; ``interval_s`` has passed since the last reading."""
        self.senses.read(self.model, self.data, interval_s)

    def drive(self, outputs: Floats) -> None:
        """Command the motors; (O,) outputs of the network."""
        self.servos.drive(self.data, outputs)

    def take(self, other: "EngineView") -> None:
        """Take over a robot's whole state from the seat that it leaves."""
        self.qpos[:], self.qvel[:] = other.qpos, other.qvel
        self.ctrl[:] = other.ctrl
        self.senses.readings[:] = other.senses.readings
        self.senses.velocities = list(other.senses.velocities)
