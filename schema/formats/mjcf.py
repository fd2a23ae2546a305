"""MJCF files that hold a whole robot: body, brain and evaluation settings.

The body is plain MJCF, for MuJoCo's viewer and other tools. Two custom texts hold the
robot in Protobuf form and the settings of an evaluation. Reading takes the robot from
the text, bit for bit, because MJCF rounds numbers. A file whose body was edited by
hand differs from its text and is refused.
"""

import base64
import binascii
from pathlib import Path

import msgspec
import mujoco
import numpy as np

from schema.errors import ExperimentError, InvalidRobot, MalformedMessage
from schema.experiment.document import body_space
from schema.experiment.settings import EvaluationSettings, read_evaluation_settings
from schema.formats.files import read_text
from schema.mjcf.model import solo_spec
from schema.robot.robot import Robot, check_robot
from schema.wire.codec import decode_robot, encode_robot

ROBOT = "revolve_robot"
SETTINGS = "revolve_settings"
"""Names of the two custom texts."""

_DIGITS = 1e-4
"""Relative difference that is greater than MJCF's rounding."""
_LENGTH_M = 1e-6
_COMPARED = ("body_mass", "geom_size", "geom_pos", "geom_quat", "jnt_range")


def robot_to_mjcf(robot: Robot, settings: EvaluationSettings) -> str:
    """Return the MJCF text of a robot on its ground, with brain and settings.

    Args:
        robot: the robot.
        settings: of its evaluation.

    Raises:
        InvalidRobot: the robot is not well formed in the settings' body space.
    """
    space = body_space(settings.space)
    check_robot(robot, space)
    spec = solo_spec(robot, space, settings.simulation, settings.environment)
    spec.modelname = "robot"
    for name, data in (
        (ROBOT, encode_robot(robot)),
        (SETTINGS, msgspec.json.encode(settings)),
    ):
        text = spec.add_text()
        text.name, text.data = name, base64.b64encode(data).decode("ascii")
    spec.compile()
    return str(spec.to_xml())


def robot_from_mjcf(text: str, where: str) -> tuple[Robot, EvaluationSettings]:
    """Return the robot and the settings of an MJCF text.

    Args:
        text: of an MJCF file.
        where: its name, for messages.

    Raises:
        InvalidRobot: not MJCF; no robot or settings in it; a body that differs from
            the robot's.
    """
    try:
        spec = mujoco.MjSpec.from_string(text)
        model = spec.compile()
    except ValueError as error:
        reason = " ".join(str(error).split())
        raise InvalidRobot(f"{where}: not valid MJCF: {reason}") from None
    held = {one.name: one.data for one in spec.texts}
    try:
        robot = decode_robot(_bytes(held, ROBOT))
        settings = read_evaluation_settings(_bytes(held, SETTINGS))
        space = body_space(settings.space)
        check_robot(robot, space)
    except (MalformedMessage, ExperimentError, InvalidRobot) as error:
        raise InvalidRobot(f"{where}: {error}") from None
    built = solo_spec(robot, space, settings.simulation, settings.environment).compile()
    _check_body(model, built, where)
    return robot, settings


def read_mjcf(path: Path) -> tuple[Robot, EvaluationSettings]:
    """Return the robot and the settings of a file.

    Raises:
        InvalidRobot: as ``robot_from_mjcf``, or the file cannot be read.
    """
    return robot_from_mjcf(read_text(path), str(path))


def _bytes(held: dict[str, str], name: str) -> bytes:
    if name not in held:
        raise InvalidRobot(
            f"has no text {name!r}: only MJCF that `revolve robot convert` wrote "
            "contains a brain"
        )
    try:
        return base64.b64decode(held[name], validate=True)
    except binascii.Error as error:
        raise InvalidRobot(f"text {name!r}: {error}") from None


def _check_body(found: mujoco.MjModel, built: mujoco.MjModel, where: str) -> None:
    """Raise if the body of a file differs from the robot's by more than rounding."""
    counts = ("nbody", "ngeom", "njnt", "nu")
    differing = [n for n in counts if getattr(found, n) != getattr(built, n)]
    if not differing:
        differing = [
            name
            for name in _COMPARED
            if not np.allclose(
                getattr(found, name), getattr(built, name), rtol=_DIGITS, atol=_LENGTH_M
            )
        ]
    if differing:
        raise InvalidRobot(
            f"{where}: its body differs from the robot in its text "
            f"({', '.join(differing)}): edit the robot's YAML and convert it again"
        )
