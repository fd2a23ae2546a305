"""Writer of a robot's body as URDF, for other tools.

Links are the rigid segments of the robot, with the names of its MuJoCo bodies. URDF has
no elements for brains and servos, which are left out.
"""

import math
from xml.etree import ElementTree as ET

import mujoco
import numpy as np

from schema.errors import InvalidRobot, one_line
from schema.experiment.document import Simulation
from schema.mjcf.model import robot_spec
from schema.parts import BodySpace
from schema.robot.robot import Robot, check_body, check_tree
from schema.robot.trace import Floats

_FREE = (0.0, 1e6)
"""Effort [N m] and velocity [rad/s] of a joint without a motor, or [N] and [m/s] of a
slider; URDF needs both."""


def robot_to_urdf(robot: Robot, space: BodySpace, simulation: Simulation) -> str:
    """Return the URDF text of a robot's body, in m, kg and rad.

    The simulation has the factors of masses and torques, and the damping of the joints.

    Raises:
        InvalidRobot: a body that is not well formed, or that MuJoCo cannot build.
    """
    check_tree(robot.parts)
    check_body(robot.parts, space)
    try:
        model = robot_spec(robot, space, simulation).spec.compile()
    except ValueError as error:
        raise InvalidRobot(f"cannot be built: {one_line(error)}") from None
    root = ET.Element("robot", name="robot")
    for body in range(1, model.nbody):
        root.append(_link(model, body))
    for joint in range(1, model.njnt):
        part = int(model.joint(joint).name.removeprefix("joint"))
        motor = space[robot.parts[part].kind].motor
        effort, velocity = _FREE
        if motor is not None:
            effort = motor.max_torque * simulation.torque_factor
            velocity = motor.max_velocity
        root.append(_joint(model, joint, effort, velocity))
    ET.indent(root)
    return ET.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def _link(model: mujoco.MjModel, body: int) -> ET.Element:
    link = ET.Element("link", name=model.body(body).name)
    inertial = ET.SubElement(link, "inertial")
    inertial.append(_origin(model.body_ipos[body], model.body_iquat[body]))
    ET.SubElement(inertial, "mass", value=repr(float(model.body_mass[body])))
    ixx, iyy, izz = map(float, model.body_inertia[body])
    own = {"ixx": ixx, "iyy": iyy, "izz": izz, "ixy": 0.0, "ixz": 0.0, "iyz": 0.0}
    ET.SubElement(inertial, "inertia", {name: repr(own[name]) for name in sorted(own)})
    first = int(model.body_geomadr[body])
    for geom in range(first, first + int(model.body_geomnum[body])):
        name = model.geom(geom).name
        for role in ("visual", "collision"):
            shown = ET.SubElement(link, role, name=name)
            shown.append(_origin(model.geom_pos[geom], model.geom_quat[geom]))
            shown.append(_geometry(model, geom))
            if role == "visual":
                material = ET.SubElement(shown, "material", name=name)
                ET.SubElement(material, "color", rgba=_numbers(model.geom_rgba[geom]))
    return link


def _geometry(model: mujoco.MjModel, geom: int) -> ET.Element:
    made = ET.Element("geometry")
    size = 2.0 * model.geom_size[geom]
    if model.geom_type[geom] == mujoco.mjtGeom.mjGEOM_CYLINDER:
        radius, length = repr(float(model.geom_size[geom][0])), repr(float(size[1]))
        ET.SubElement(made, "cylinder", radius=radius, length=length)
    else:
        ET.SubElement(made, "box", size=_numbers(size))
    return made


def _joint(
    model: mujoco.MjModel, joint: int, effort: float, velocity: float
) -> ET.Element:
    body = int(model.jnt_bodyid[joint])
    parent = model.body(int(model.body_parentid[body])).name
    kind = "revolute" if model.jnt_limited[joint] else "continuous"
    if model.jnt_type[joint] == mujoco.mjtJoint.mjJNT_SLIDE:
        kind = "prismatic"
    made = ET.Element("joint", name=model.joint(joint).name, type=kind)
    made.append(_origin(model.body_pos[body], model.body_quat[body]))
    ET.SubElement(made, "parent", link=parent)
    ET.SubElement(made, "child", link=model.body(body).name)
    ET.SubElement(made, "axis", xyz=_numbers(model.jnt_axis[joint]))
    low, high = map(float, model.jnt_range[joint])
    limits = {"lower": low, "upper": high, "effort": effort, "velocity": velocity}
    if not model.jnt_limited[joint]:
        del limits["lower"], limits["upper"]
    ET.SubElement(made, "limit", {name: repr(value) for name, value in limits.items()})
    damping = float(model.dof_damping[model.jnt_dofadr[joint]])
    ET.SubElement(made, "dynamics", damping=repr(damping))
    return made


def _origin(position: Floats, quaternion: Floats) -> ET.Element:
    """Return a frame: position [m], and roll, pitch, yaw about fixed axes [rad]."""
    matrix = np.empty(9)
    mujoco.mju_quat2Mat(matrix, quaternion)
    m = matrix.reshape(3, 3)
    pitch = math.asin(max(-1.0, min(1.0, -m[2, 0])))
    if abs(m[2, 0]) < 1.0 - 1e-12:
        roll, yaw = math.atan2(m[2, 1], m[2, 2]), math.atan2(m[1, 0], m[0, 0])
    else:
        # Gimbal lock: roll and yaw turn about the same axis.
        roll, yaw = 0.0, math.atan2(-m[0, 1], m[1, 1])
    angles = np.array((roll, pitch, yaw))
    return ET.Element("origin", xyz=_numbers(position), rpy=_numbers(angles))


def _numbers(values: Floats) -> str:
    return " ".join(repr(float(value)) for value in values)
