"""MJCF files that hold a whole robot: body, brain and evaluation settings.

The body is plain MJCF, for MuJoCo's viewer and other tools. Three custom texts hold the
robot in Protobuf form, the settings of an evaluation, and a digest of the file. Reading
takes the robot from the text, bit for bit; MuJoCo does not parse the file. One that was
edited by hand differs from its digest and is refused. Files of versions before 0.3 have
no digest.
"""

import base64
import binascii
import copy
from hashlib import sha256
from pathlib import Path
from xml.etree import ElementTree as ET

import msgspec

from schema.errors import ExperimentError, InvalidRobot, MalformedMessage, one_line
from schema.experiment.brains import types_of
from schema.experiment.settings import EvaluationSettings, read_evaluation_settings
from schema.formats.mjcf_export import add_limits, add_sensors, exact_xml, portable
from schema.limits import MOST_MJCF_BYTES
from schema.mjcf.model import solo_spec
from schema.plugins.bounded import parse_xml, text_of
from schema.robot.robot import Robot, check_number, check_robot
from schema.wire.protobuf import decode_robot, encode_robot

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
