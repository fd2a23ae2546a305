"""MJCF files that hold a whole robot: body, brain and evaluation settings.

The body is plain MJCF, for MuJoCo's viewer and other tools. Two custom texts hold the
robot in Protobuf form and the settings of an evaluation. Reading takes the robot from
the text, bit for bit. A file whose body or world was edited by hand differs from its
text and is refused; earlier files have six digits.
"""

import base64
import binascii
import warnings
from collections import Counter
from pathlib import Path
from xml.etree import ElementTree as ET

import msgspec
import mujoco
import numpy as np

from schema.errors import (
    ExperimentError,
    InvalidRobot,
    MalformedMessage,
    cut,
    one_line,
    shown,
)
from schema.experiment.bounded import is_finite, parse_xml
from schema.experiment.brains import types_of
from schema.experiment.environment import MOST_PATCHES
from schema.experiment.settings import EvaluationSettings, read_evaluation_settings
from schema.formats.contents import read_text
from schema.formats.mjcf_export import add_limits, add_sensors, exact_xml, portable
from schema.limits import MOST_MJCF_BYTES, MOST_OTHERS
from schema.mjcf.model import solo_spec
from schema.robot.robot import Robot, check_number, check_robot
from schema.wire.protobuf import decode_robot, encode_robot

ROBOT = "revolve_robot"
SETTINGS = "revolve_settings"
"""Names of the two custom texts."""

_ALLOWED = (
    *("mujoco", "compiler", "option", "flag", "size", "default", "asset", "hfield"),
    *("worldbody", "body", "joint", "freejoint", "inertial", "geom", "site"),
    *("light", "camera", "actuator", "general", "velocity", "custom", "text"),
    *("sensor", "accelerometer", "gyro", "touch", "numeric"),
    *("statistic", "visual", "global", "quality", "headlight", "map", "scale", "rgba"),
)
"""Elements that are allowed: none reads another file or makes more elements."""
_ONLY = {
    "size": ("memory",),
    "numeric": ("name", "data"),
    "compiler": ("angle", "autolimits", "coordinate", "eulerseq"),
}
"""Attributes of elements that could make MuJoCo reserve memory or read files."""
_WORDS = ("name", "class", "childclass", "model", "data")
"""Attributes whose values are not numbers."""
_SIDES = frozenset(map(str, range(1, MOST_PATCHES + 2)))
_DIGITS = 1e-4
"""Relative difference that is greater than the rounding of earlier files."""
_INERTIA = 1e-2
"""The same of inertia, which sums up the rounding of many positions."""
_LENGTH_M = 1e-6
_SIZES = (
    *("nbody", "ngeom", "njnt", "nsite", "nu", "nq", "nv", "na", "nsensor"),
    *("nhfield", "nhfielddata", "nnumeric", "nnumericdata"),
)
_PLACES = (
    *("body_pos", "body_quat", "body_ipos", "qpos0", "qpos_spring"),
    *("geom_size", "geom_pos", "geom_quat", "site_size", "site_pos", "site_quat"),
    *("jnt_range", "jnt_pos", "jnt_axis", "hfield_size", "hfield_data"),
)
"""Compared up to ``_LENGTH_M``; all others to the digits that MJCF has."""
_BODY = (
    *("body_parentid", "geom_bodyid", "jnt_bodyid", "site_bodyid"),
    *("body_mass", "body_inertia", "body_gravcomp", "geom_type", "geom_fluid"),
    *("jnt_type", "jnt_limited", "jnt_margin", "jnt_solref", "jnt_solimp"),
    *("jnt_stiffness", "jnt_actfrclimited", "jnt_actfrcrange", "jnt_actgravcomp"),
    *("dof_damping", "dof_armature", "dof_frictionloss", "dof_solref", "dof_solimp"),
    *("actuator_trntype", "actuator_trnid", "actuator_gear", "actuator_dyntype"),
    *("actuator_gaintype", "actuator_gainprm", "actuator_biastype", "actuator_biasprm"),
    *("actuator_forcelimited", "actuator_forcerange", "actuator_delay"),
    *("actuator_ctrllimited", "actuator_ctrlrange"),
    *("actuator_damping", "actuator_armature"),
    *("sensor_type", "sensor_objid", "sensor_cutoff", "sensor_noise", "sensor_delay"),
    "numeric_data",
)
_WORLD = (
    *("geom_contype", "geom_conaffinity", "geom_condim", "geom_priority"),
    *("geom_friction", "geom_solref", "geom_solimp", "geom_solmix"),
    *("geom_margin", "geom_gap", "geom_surfacevel", "geom_adhesion"),
    *("hfield_size", "hfield_data"),
)
_OPTIONS = (
    *("timestep", "gravity", "wind", "magnetic", "density", "viscosity"),
    *("integrator", "cone", "jacobian", "solver", "impratio"),
    *("iterations", "tolerance", "ls_iterations", "ls_tolerance"),
    *("noslip_iterations", "noslip_tolerance", "ccd_iterations", "ccd_tolerance"),
    *("o_margin", "o_solref", "o_solimp", "o_friction"),
    *("disableflags", "enableflags", "disableactuator"),
)


def robot_to_mjcf(robot: Robot, settings: EvaluationSettings) -> str:
    """Return the MJCF text of a robot on its ground, with brain and settings.

    Args:
        robot: the robot.
        settings: of its evaluation.

    Raises:
        InvalidRobot: the robot is not well formed in the settings' body space, or
            MuJoCo cannot build it; MJCF beyond the limits of reading, as of about 400
            bodies, each on the last.
    """
    space, kinds = types_of(settings)
    check_robot(robot, space, kinds)
    try:
        spec = solo_spec(robot, space, settings.simulation, settings.environment)
        add_sensors(spec, robot, space)
        add_limits(spec, robot, space)
        spec.modelname = "robot"
        for name, data in (
            (ROBOT, encode_robot(robot)),
            (SETTINGS, msgspec.json.encode(settings)),
        ):
            text = spec.add_text()
            text.name, text.data = name, base64.b64encode(data).decode("ascii")
        spec.compile()
    except ValueError as error:
        raise InvalidRobot(f"cannot be built: {one_line(error)}") from None
    try:
        return portable(parse_xml(exact_xml(spec), MOST_MJCF_BYTES))
    except ValueError as error:
        raise InvalidRobot(f"MJCF {error}: a .pb file holds any robot") from None


def robot_from_mjcf(text: str, where: str) -> tuple[Robot, EvaluationSettings]:
    """Return the robot and the settings of an MJCF text.

    Args:
        text: of an MJCF file.
        where: its name, for messages.

    Raises:
        InvalidRobot: not MJCF, or MJCF that a robot does not need; no robot or
            settings in it; a body that differs from the robot's, or a world that
            differs from the settings'.
    """
    try:
        root = parse_xml(text, MOST_MJCF_BYTES)
    except ValueError as error:
        raise InvalidRobot(f"{where}: not valid MJCF: {error}") from None
    held = {each.get("name", ""): each.get("data", "") for each in root.iter("text")}
    if ROBOT in held:  # else the reason of a foreign file is not one of its elements
        _check_elements(root, where)
    try:
        robot = decode_robot(_bytes(held, ROBOT))
        settings = read_evaluation_settings(_bytes(held, SETTINGS))
        space, kinds = types_of(settings)
        check_number(robot)
        check_robot(robot, space, kinds)
        spec = solo_spec(robot, space, settings.simulation, settings.environment)
        # Earlier files have no sensors, or no limits of motors.
        if root.find("sensor") is not None:
            add_sensors(spec, robot, space)
        if root.find("actuator/*[@ctrlrange]") is not None:
            add_limits(spec, robot, space)
        built = spec.compile()
    except (MalformedMessage, ExperimentError, InvalidRobot, ValueError) as error:
        raise InvalidRobot(f"{where}: {one_line(error)}") from None
    _check_counts(root, built, where)
    try:
        # The text that was checked, not the original one.
        checked = ET.tostring(root, encoding="unicode")
        with warnings.catch_warnings():
            # Of an edited inertia: the error below names what was edited.
            warnings.simplefilter("ignore")
            model = mujoco.MjSpec.from_string(checked).compile()
    except (ValueError, RecursionError) as error:
        raise InvalidRobot(f"{where}: not valid MJCF: {one_line(error)}") from None
    _check_body(model, built, where)
    return robot, settings


def _check_elements(root: ET.Element, where: str) -> None:
    """Raise for elements that read other files, or that no robot needs."""
    for element in root.iter():
        if element.tag not in _ALLOWED:
            raise InvalidRobot(
                f"{where}: <{cut(element.tag)}> is not allowed in a robot's MJCF; "
                f"allowed: {', '.join(_ALLOWED)}"
            )
        allowed = _ONLY.get(element.tag, element.attrib)
        for key, value in element.items():
            if key.startswith("file") or key == "user" or key not in allowed:
                raise InvalidRobot(
                    f"{where}: <{element.tag} {cut(key)}={shown(value)}> is not "
                    "allowed in a robot's MJCF"
                )
            if key not in _WORDS and not is_finite(value):
                raise InvalidRobot(
                    f"{where}: <{element.tag} {cut(key)}={shown(value)}> must be finite"
                )
            if key in ("nrow", "ncol") and value not in _SIDES:
                raise InvalidRobot(
                    f"{where}: <{element.tag} {key}={shown(value)}> must be a whole "
                    f"number <= {MOST_PATCHES + 1}"
                )


def _check_counts(root: ET.Element, built: mujoco.MjModel, where: str) -> None:
    """Raise if a file has not as many elements as the robot in its text."""
    inside = Counter(
        element.tag for world in root.iter("worldbody") for element in world.iter()
    )
    found = {
        # With the root of the tree of bodies, which is no element of its own.
        "nbody": inside["body"] + 1,
        "ngeom": inside["geom"],
        "njnt": inside["joint"] + inside["freejoint"],
        "nsite": inside["site"],
        "nu": sum(len(element) for element in root.iter("actuator")),
        "nsensor": sum(len(element) for element in root.iter("sensor")),
        "nhfield": sum(1 for _ in root.iter("hfield")),
    }
    if differing := [name for name in found if found[name] != getattr(built, name)]:
        raise _differs(differing, where)
    others = Counter(element.tag for element in root.iter())
    for tag in ("light", "camera", "default", "text"):
        if others[tag] > MOST_OTHERS:
            raise InvalidRobot(
                f"{where}: must have <= {MOST_OTHERS} <{tag}>, got {others[tag]}"
            )


def _differs(names: list[str], where: str) -> InvalidRobot:
    listed = ", ".join(names)
    if all(name in _WORLD or name.startswith("opt.") for name in names):
        return InvalidRobot(
            f"{where}: its world differs from the settings in its text ({listed}): "
            "edit the experiment and convert the robot again with --experiment"
        )
    return InvalidRobot(
        f"{where}: its body differs from the robot in its text ({listed}): edit the "
        "robot's YAML, or the experiment, and convert it again"
    )


def read_mjcf(path: Path) -> tuple[Robot, EvaluationSettings]:
    """Return the robot and the settings of a file.

    Raises:
        InvalidRobot: as ``robot_from_mjcf``, or the file cannot be read.
    """
    return robot_from_mjcf(read_text(path, MOST_MJCF_BYTES), str(path))


def _bytes(held: dict[str, str], name: str) -> bytes:
    if name not in held:
        raise InvalidRobot(
            f"has no text {name!r}: only MJCF that `revolve robot convert` wrote is "
            "read, which contains the brain"
        )
    try:
        return base64.b64decode(held[name], validate=True)
    except binascii.Error as error:
        raise InvalidRobot(f"text {name!r}: {error}") from None


def _check_body(found: mujoco.MjModel, built: mujoco.MjModel, where: str) -> None:
    """Raise if body or world of a file differ from the robot's by more than rounding.

    What has no effect on the robot is not compared: names, lights, the colour of the
    ground, the size of the memory.
    """
    if differing := [n for n in _SIZES if getattr(found, n) != getattr(built, n)]:
        raise _differs(differing, where)
    # Earlier versions placed robots at other heights on uneven ground.
    root = built.body("root").id
    found.body_pos[root, 2] = built.body_pos[root, 2]
    for name in ("qpos0", "qpos_spring"):
        getattr(found, name)[2] = getattr(built, name)[2]
    differing = [
        name
        for name in dict.fromkeys((*_PLACES, *_BODY, *_WORLD))
        if not _is_close(found, built, name, _LENGTH_M if name in _PLACES else 0.0)
    ]
    # The ground and static scenery may have other colours.
    parts = built.geom_bodyid > 0
    if not np.allclose(found.geom_rgba[parts], built.geom_rgba[parts], rtol=_DIGITS):
        differing.append("geom_rgba")
    differing += [
        f"opt.{name}"
        for name in _OPTIONS
        if not _is_close(found.opt, built.opt, name, 0.0)
    ]
    if differing:
        raise _differs(differing, where)


def _is_close(found: object, built: object, name: str, atol: float) -> bool:
    values = getattr(found, name), getattr(built, name)
    rtol = _INERTIA if name == "body_inertia" else _DIGITS
    if np.asarray(values[0]).dtype.kind in "biu":
        # Bits of flags and numbers of elements are not rounded.
        rtol = 0.0
    return np.allclose(*values, rtol=rtol, atol=atol)
