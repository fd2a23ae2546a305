"""Robot files: the ending decides what is written and read.

YAML for people (.yaml, .yml), Protobuf for machines (.pb) and MJCF for MuJoCo (.xml)
hold a whole robot, so one becomes the other and back without loss. URDF (.urdf)
holds its body only and is written, not read. RoboGen's text (.txt) and JSON (.json)
are read, not written.
"""

from pathlib import Path

from schema.errors import InvalidRobot, MalformedMessage
from schema.experiment.document import Experiment, Fitness, Simulation, Space
from schema.experiment.settings import EvaluationSettings
from schema.formats.robogen_json import robot_from_robogen_json
from schema.formats.robogen_text import robot_from_robogen_text
from schema.formats.yaml import robot_from_yaml, robot_to_yaml
from schema.parts import BUILT_IN, BodySpace
from schema.robot.robot import Robot, check_robot
from schema.wire.codec import decode_robot, encode_robot

YAML_ENDINGS = (".yaml", ".yml")
PROTOBUF_ENDINGS = (".pb",)
MJCF_ENDING = ".xml"
URDF_ENDING = ".urdf"
_TEXTS = {
    ".yaml": robot_from_yaml,
    ".yml": robot_from_yaml,
    ".txt": robot_from_robogen_text,
    ".json": robot_from_robogen_json,
}
_READ = (*_TEXTS, *PROTOBUF_ENDINGS, MJCF_ENDING)
_WRITTEN = (*YAML_ENDINGS, *PROTOBUF_ENDINGS, MJCF_ENDING, URDF_ENDING)
_ANY_BUILT_IN = Space(part_types=(*Space().part_types, "schema.parts:LIGHT_SENSOR"))


def settings_of(experiment: Experiment | None) -> EvaluationSettings:
    """Return how an experiment judges robots.

    Args:
        experiment: None for the thesis's values, with all built-in part types.
    """
    if experiment is None:
        return EvaluationSettings(
            space=_ANY_BUILT_IN, simulation=Simulation(), fitness=Fitness()
        )
    return EvaluationSettings(
        space=experiment.space,
        simulation=experiment.simulation,
        fitness=experiment.fitness,
        environment=experiment.environment,
    )


def read_robot(path: Path, space: BodySpace = BUILT_IN) -> Robot:
    """Return the robot of a file.

    Args:
        path: ends in .yaml, .yml, .pb, .xml, .txt or .json.
        space: the part types that it may use.

    Raises:
        InvalidRobot: another ending, a file that cannot be read, a text that is no
            robot, or a robot that is not well formed in this body space.
        MalformedMessage: bytes that are no robot.
    """
    ending = _ending(path, _READ)
    if ending == MJCF_ENDING:
        # The engine is loaded for its own forms only: a coordinator has no other use.
        from schema.formats.mjcf import read_mjcf  # noqa: PLC0415

        robot, _ = read_mjcf(path)
        _check(robot, space, path)
        return robot
    try:
        data = path.read_bytes()
        text = data.decode() if ending in _TEXTS else ""
    except OSError as error:
        raise InvalidRobot(f"{path}: cannot be read: {error.strerror}") from None
    except UnicodeDecodeError as error:
        raise InvalidRobot(f"{path}: byte {error.start} is no text") from None
    if ending in _TEXTS:
        return _TEXTS[ending](text, str(path), space)
    try:
        robot = decode_robot(data)
    except MalformedMessage as error:
        raise MalformedMessage(f"{path}: {error}") from None
    _check(robot, space, path)
    return robot


def write_robot(
    robot: Robot,
    path: Path,
    space: BodySpace = BUILT_IN,
    settings: EvaluationSettings | None = None,
) -> None:
    """Write a robot to a file.

    Args:
        robot: the robot.
        path: ends in .yaml, .yml, .pb, .xml or .urdf.
        space: its part types.
        settings: the world that goes with it into MJCF; the thesis's by default.

    Raises:
        InvalidRobot: another ending, a robot that is not well formed in this body
            space, or a file that cannot be written.
    """
    ending = _ending(path, _WRITTEN)
    settings = settings or settings_of(None)
    if ending in YAML_ENDINGS:
        data = robot_to_yaml(robot, space).encode()
    elif ending in PROTOBUF_ENDINGS:
        check_robot(robot, space)
        data = encode_robot(robot)
    elif ending == MJCF_ENDING:
        from schema.formats.mjcf import robot_to_mjcf  # noqa: PLC0415

        data = robot_to_mjcf(robot, settings).encode()
    else:
        from schema.formats.urdf import robot_to_urdf  # noqa: PLC0415

        data = robot_to_urdf(robot, space, settings.simulation).encode()
    try:
        path.write_bytes(data)
    except OSError as error:
        raise InvalidRobot(f"{path}: cannot be written: {error.strerror}") from None


def _check(robot: Robot, space: BodySpace, path: Path) -> None:
    try:
        check_robot(robot, space)
    except InvalidRobot as error:
        raise InvalidRobot(f"{path}: {error}") from None


def _ending(path: Path, endings: tuple[str, ...]) -> str:
    ending = path.suffix.lower()
    if ending not in endings:
        allowed = ", ".join(endings)
        raise InvalidRobot(f"{path}: must end in one of {allowed}, got {ending!r}")
    return ending
