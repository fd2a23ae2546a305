"""Places of a robot's elements in a model, its contacts, and the engine's warnings."""

from collections.abc import Callable
from functools import lru_cache

import mujoco
import numpy as np
import numpy.typing as npt

from schema.experiment.settings import ArenaSettings, EvaluationSettings
from schema.mjcf.model import quaternion
from schema.parts import BodySpace
from schema.robot.frames import place_parts, shapes_of
from schema.robot.robot import Robot
from schema.robot.trace import Floats

FREE, FREE_DOFS = 7, 6
"""Numbers of a free joint's position and orientation, and of its velocity."""
_IN_GAP = 1
"""Why the engine excludes a contact from the forces."""
ReadContacts = Callable[[], list[list[int]]]
"""Returns the pairs of geoms in contact in the last step, as plain numbers."""


class PlacedRobot:
    """A robot in a model, which is found there by the prefix of its names.

    Attributes:
        model, data: a compiled model that holds it, and the model's state.
        prefix: of its names in the model.
        root: its first body.
        joints, dofs: its slices of the model's positions and velocities.
        geoms: first and last + 1 of its geoms.
    """

    def __init__(
        self,
        robot: Robot,
        space: BodySpace,
        model: mujoco.MjModel,
        data: mujoco.MjData,
        prefix: str = "",
    ) -> None:
        self.robot, self.space, self.prefix = robot, space, prefix
        self.model, self.data = model, data
        free = model.joint(f"{prefix}free").id
        self.root = int(model.jnt_bodyid[free])
        bodies = (model.body_rootid == self.root).nonzero()[0]
        # One of a number each, besides the free joint.
        joints = int(model.body_jntnum[bodies].sum()) - 1
        start, dof = int(model.jnt_qposadr[free]), int(model.jnt_dofadr[free])
        self.joints = slice(start, start + FREE + joints)
        self.dofs = slice(dof, dof + FREE_DOFS + joints)
        geom = int(model.body_geomadr[self.root])
        self.geoms = (geom, geom + int(model.body_geomnum[bodies].sum()))

    def constants(
        self, settings: EvaluationSettings | ArenaSettings
    ) -> dict[str, object]:
        """Return the channels of its traces that always exist."""
        return {
            "light": settings.light,
            "robot": self.robot,
            "mass": float(self.model.body_subtreemass[self.root]),
            "gravity": settings.simulation.gravity,
        }


def part_poses(
    placed: PlacedRobot, places: Floats, attitudes: Floats, angles: Floats
) -> Floats:
    """Return the poses of all parts, (T, P, 7), as ``Trace.part_poses``.

    The other arguments are ``core_position``, ``core_attitude`` and ``joint_angle``.
    """
    model, robot, prefix = placed.model, placed.robot, placed.prefix
    data, shapes = mujoco.MjData(model), shapes_of(robot, placed.space)
    # The body beyond a joint has the part's name; the other half is its parent.
    bodies = [
        model.geom(f"{prefix}{index}/{shape.boxes[0].name}").bodyid[0]
        if shape.joint is None
        else model.body(f"{prefix}body{index}").parentid[0]
        for index, shape in enumerate(shapes)
    ]
    qpos = data.qpos[placed.joints]
    qpos[:] = 0.0
    qpos[3] = 1.0
    mujoco.mj_kinematics(model, data)
    # At neutral pose all frames of bodies are parallel to the core's.
    rotations, offsets = place_parts(robot, shapes)
    offsets -= data.xpos[bodies]
    turns = [quaternion(rotation) for rotation in rotations]
    poses = np.empty((len(places), len(bodies), 7))
    for sample, pose in enumerate(poses):
        qpos[:3], qpos[3:FREE] = places[sample], attitudes[sample]
        qpos[FREE:] = angles[sample]
        mujoco.mj_kinematics(model, data)
        frames = data.xmat[bodies].reshape(-1, 3, 3)
        pose[:, :3] = data.xpos[bodies] + (frames * offsets[:, np.newaxis]).sum(axis=2)
        for part, body, turn in zip(pose, bodies, turns, strict=True):
            mujoco.mju_mulQuat(part[3:], data.xquat[body], turn)
    return poses


def contact_reader(model: mujoco.MjModel, data: mujoco.MjData) -> ReadContacts:
    """Return a function that returns the contacts of the last step.

    The engine also reports geoms that are farther apart than their ``margin`` but
    within the ``gap`` of scenery. They exert no force on each other: no contact.
    """
    contacts, has_gaps = data.contact, bool(model.geom_gap.any())

    def read() -> list[list[int]]:
        geoms = contacts.geom
        touching = geoms[contacts.exclude != _IN_GAP] if has_gaps else geoms
        pairs: list[list[int]] = touching.tolist()
        return pairs

    return read


def warning_names(counts: npt.NDArray[np.integer]) -> str:
    """Return the names of the engine's warnings whose counts are not 0."""
    return ", ".join(
        mujoco.mjtWarning(index).name.removeprefix("mjWARN_")
        for index in counts.nonzero()[0].tolist()
    )


@lru_cache(maxsize=1)
def silence_engine() -> None:
    """Keep the engine's warnings out of stderr and of its log file.

    The engine still counts them in ``MjData.warning``.
    """
    mujoco.set_mju_user_warning(lambda _message: None)
