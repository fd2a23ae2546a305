"""Robot files: YAML for people (.yaml, .yml), Protobuf for machines (.pb).

The ending decides. Both forms hold a whole robot, so one becomes the other and
back without loss.
"""

from pathlib import Path

from schema.codec import decode_robot, encode_robot
from schema.errors import InvalidRobot, MalformedMessage
from schema.parts import BUILT_IN, BodySpace
from schema.robot import Robot, check_robot
from schema.yaml_form import robot_from_yaml, robot_to_yaml

YAML_ENDINGS = (".yaml", ".yml")
PROTOBUF_ENDINGS = (".pb",)


def read_robot(path: Path, space: BodySpace = BUILT_IN) -> Robot:
    """Return the robot of a file.

    Args:
        path: ends in .yaml, .yml or .pb.
        space: the part types that it may use.

    Raises:
        InvalidRobot: another ending, a file that cannot be read, a text that is no
            robot, or a robot that is not well formed in this body space.
        MalformedMessage: bytes that are no robot.
    """
    is_yaml = _is_yaml(path)
    try:
        data = path.read_bytes()
        text = data.decode() if is_yaml else ""
    except OSError as error:
        raise InvalidRobot(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise InvalidRobot(f"{path}: not YAML: byte {error.start} is no text") from None
    if is_yaml:
        return robot_from_yaml(text, str(path), space)
    try:
        robot = decode_robot(data)
        check_robot(robot, space)
    except MalformedMessage as error:
        raise MalformedMessage(f"{path}: {error}") from None
    except InvalidRobot as error:
        raise InvalidRobot(f"{path}: {error}") from None
    return robot


def write_robot(robot: Robot, path: Path, space: BodySpace = BUILT_IN) -> None:
    """Write a robot to a file.

    Args:
        robot: the robot.
        path: ends in .yaml, .yml or .pb.
        space: its part types.

    Raises:
        InvalidRobot: another ending, a robot that is not well formed in this body
            space, or a file that cannot be written.
    """
    if _is_yaml(path):
        data = robot_to_yaml(robot, space).encode()
    else:
        check_robot(robot, space)
        data = encode_robot(robot)
    try:
        path.write_bytes(data)
    except OSError as error:
        raise InvalidRobot(f"{path}: cannot be written: {error.strerror}") from None


def _is_yaml(path: Path) -> bool:
    ending = path.suffix.lower()
    if ending not in YAML_ENDINGS + PROTOBUF_ENDINGS:
        allowed = ", ".join(YAML_ENDINGS + PROTOBUF_ENDINGS)
        raise InvalidRobot(f"{path}: must end in one of {allowed}, got {ending!r}")
    return ending in YAML_ENDINGS
