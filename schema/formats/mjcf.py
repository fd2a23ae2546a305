"""MJCF files that hold a whole robot: body, brain and evaluation settings.

The body is plain MJCF, for MuJoCo's viewer and other tools. Three custom texts hold the
robot in Protobuf form, the settings of an evaluation, and a digest of the file. Reading
takes the robot from the text, bit for bit; MuJoCo does not parse the file. One that was
edited by hand differs from its digest and is refused. Files of versions before 0.3 have
no digest.

The world is as other tools read it: dm_control reserves ``/`` in names, so that
``3/servo`` becomes ``3_servo``. The sensors are only for other tools: our own readings
follow from positions, velocities and contacts. MuJoCo has no sensor of light.
"""

import base64
import binascii
import copy
import ctypes
import re
from hashlib import sha256
from pathlib import Path
from xml.etree import ElementTree as ET

import msgspec
import mujoco

from schema.errors import ExperimentError, InvalidRobot, MalformedMessage, one_line
from schema.experiment.brains import types_of
from schema.experiment.settings import EvaluationSettings, read_evaluation_settings
from schema.limits import MOST_MJCF_BYTES
from schema.mjcf.model import solo_spec
from schema.parts import BodySpace, Sensor
from schema.plugins.bounded import parse_xml, text_of
from schema.robot.robot import Robot, check_number, check_robot
from schema.wire.protobuf import decode_robot, encode_robot

_PAD_M = 0.001
"""Margin of the site of a touch sensor about its box [m]: contacts lie on its faces."""
_LONG = re.compile(r"\d+\.\d{8,}(?:e[+-]\d+)?")


def add_sensors(spec: mujoco.MjSpec, robot: Robot, space: BodySpace) -> None:
    """Add the sensors of a robot, and rename all elements with ``/`` in their names.

    An imu becomes ``{p}_accelerometer`` and ``{p}_gyro``, where p is the index of its
    part, and a touch sensor ``{p}_{box}_touch``.
    """
    _rename(spec)
    for index, part in enumerate(robot.parts):
        for sensor in space[part.kind].sensors:
            if not isinstance(sensor, Sensor):
                continue
            if sensor.kind == "imu":
                kinds = mujoco.mjtSensor
                site = f"{index}_imu"
                _add(spec, kinds.mjSENS_ACCELEROMETER, site, f"{index}_accelerometer")
                _add(spec, kinds.mjSENS_GYRO, site, f"{index}_gyro")
            elif sensor.kind == "touch":
                name = f"{index}_{sensor.box}_touch"
                _add_pad(spec.geom(f"{index}_{sensor.box}"), name)
                _add(spec, mujoco.mjtSensor.mjSENS_TOUCH, name, name)


def add_limits(spec: mujoco.MjSpec, robot: Robot, space: BodySpace) -> None:
    """Add the range of the velocities that motors take, and their gains.

    Gains are custom numbers [1/s], one for each actuator; 0 is a motor that controls
    the velocity. Arguments as of ``add_sensors``.
    """
    gains: list[float] = []
    for servo in spec.actuators:
        motor = space[robot.parts[int(servo.name.removeprefix("joint"))].kind].motor
        assert motor is not None
        servo.ctrllimited = 1
        servo.ctrlrange = (-motor.max_velocity, motor.max_velocity)
        gains.append(motor.gain if motor.control == "position" else 0.0)
    if gains:
        numbers = spec.add_numeric()
        numbers.name, numbers.size, numbers.data = "motor_gain", len(gains), gains


def exact_xml(spec: mujoco.MjSpec) -> str:
    """Return the XML of a compiled spec with all digits: with six, gaits differ."""
    # MuJoCo has no public setting of the digits. Its bindings load this library, too.
    engine = ctypes.CDLL(mujoco._functions.__file__)  # noqa: SLF001
    usual = engine._mjPRIVATE__get_xml_precision()  # noqa: SLF001
    engine._mjPRIVATE__set_xml_precision(17)  # noqa: SLF001
    try:
        # Short numbers stay short: 0.005, not 0.0050000000000000001.
        return _LONG.sub(lambda found: repr(float(found[0])), spec.to_xml())
    finally:
        engine._mjPRIVATE__set_xml_precision(usual)  # noqa: SLF001


def portable(root: ET.Element) -> ET.Element:
    """Return MJCF, changed in place, whose servos are ``velocity`` elements.

    MuJoCo 4 writes them as ``general`` elements with an attribute ``input``, which
    MuJoCo 3.3 and earlier do not know. Both give the same model.
    """
    for servo in root.iterfind("actuator/general[@input='vel']"):
        servo.tag = "velocity"
        servo.set("kv", servo.attrib.pop("gainprm", "1"))
        for name in ("input", "biastype", "biasprm"):
            del servo.attrib[name]
    for numbers in root.iterfind("custom/numeric"):
        del numbers.attrib["size"]  # of the data
    return root


def _rename(spec: mujoco.MjSpec) -> None:
    """Replace ``/`` in all names, which are unique among elements of a kind."""
    for elements in (spec.bodies, spec.joints, spec.geoms, spec.sites):
        taken = {element.name for element in elements}
        for element in elements:
            if "/" in element.name:
                name = element.name.replace("/", "_")
                while name in taken:
                    name += "_"
                taken.add(name)
                element.name = name


def _add(spec: mujoco.MjSpec, kind: mujoco.mjtSensor, site: str, name: str) -> None:
    sensor = spec.add_sensor()
    sensor.name, sensor.type = name, kind
    sensor.objtype, sensor.objname = mujoco.mjtObj.mjOBJ_SITE, site


def _add_pad(geom: mujoco.MjsGeom, name: str) -> None:
    """Add the site within which a touch sensor feels contacts of its box."""
    site = geom.parent.add_site()
    site.name, site.type = name, geom.type
    site.pos, site.quat = geom.pos, geom.quat
    site.size = [size + _PAD_M for size in geom.size]


ROBOT = "revolve_robot"
SETTINGS = "revolve_settings"
DIGEST = "revolve_digest"
"""Names of the three custom texts."""

_FREE_ELEMENTS = ("light", "camera", "visual", "statistic", "size")
"""Elements that have no effect on a robot: they are not part of the digest."""
_FREE_OF_WORLD = ("name", "rgba", "material")
"""Attributes of the ground and static scenery that have none, either."""


def robot_to_mjcf(robot: Robot, settings: EvaluationSettings) -> str:
    """Return the MJCF text of a robot on its ground, with brain and settings.

    Raises:
        InvalidRobot: a robot that is not well formed, or that MuJoCo cannot build; MJCF
            beyond the limits of reading, as of about 400 bodies, each on the last.
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
        root = portable(parse_xml(exact_xml(spec), MOST_MJCF_BYTES))
    except ValueError as error:
        raise InvalidRobot(f"MJCF {error}: a .pb file holds any robot") from None
    digest = _digest(copy.deepcopy(root))
    ET.SubElement(ET.SubElement(root, "custom"), "text", name=DIGEST, data=digest)
    return ET.tostring(root, encoding="unicode") + "\n"


def robot_from_mjcf(text: str, where: str) -> tuple[Robot, EvaluationSettings]:
    """Return the robot and the settings of an MJCF text.

    Raises:
        InvalidRobot: not MJCF; no robot or settings in it; a file that was edited.
    """
    try:
        root = parse_xml(text, MOST_MJCF_BYTES)
    except ValueError as error:
        raise InvalidRobot(f"{where}: not valid MJCF: {error}") from None
    held = {each.get("name", ""): each.get("data", "") for each in root.iter("text")}
    try:
        robot = decode_robot(_bytes(held, ROBOT))
        settings = read_evaluation_settings(_bytes(held, SETTINGS))
        space, kinds = types_of(settings)
        check_number(robot)
        check_robot(robot, space, kinds)
    except (MalformedMessage, ExperimentError, InvalidRobot) as error:
        raise InvalidRobot(f"{where}: {one_line(error)}") from None
    if DIGEST in held and held[DIGEST] != _digest(root):
        edit = "edit the robot's YAML, or the experiment, and convert it again"
        why = "was edited and no longer fits the robot in its text"
        raise InvalidRobot(f"{where}: {why}: {edit}")
    return robot, settings


def _digest(root: ET.Element) -> str:
    """Return the SHA-256 of a file without what has no effect on a robot, in place."""
    for section in root.findall(f"custom/text[@name='{DIGEST}']/.."):
        root.remove(section)
    for geom in root.iterfind("worldbody/geom"):
        for key in _FREE_OF_WORLD:
            geom.attrib.pop(key, None)
    text = ET.canonicalize(
        ET.tostring(root, encoding="unicode"),
        strip_text=True,
        exclude_tags=_FREE_ELEMENTS,
    )
    return sha256(text.encode()).hexdigest()


def read_mjcf(path: Path) -> tuple[Robot, EvaluationSettings]:
    """Return the robot and the settings of a file; errors as of ``robot_from_mjcf``."""
    text = text_of(path, str(path), most=MOST_MJCF_BYTES, kind=InvalidRobot)
    return robot_from_mjcf(text, str(path))


def _bytes(held: dict[str, str], name: str) -> bytes:
    if name not in held:
        read = "only MJCF that `revolve robot convert` wrote is read, with the brain"
        raise InvalidRobot(f"has no text {name!r}: {read}")
    try:
        return base64.b64decode(held[name], validate=True)
    except binascii.Error as error:
        raise InvalidRobot(f"text {name!r}: {error}") from None
