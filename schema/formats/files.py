"""Robot files: the file name's ending selects the format.

YAML (.yaml, .yml), Protobuf (.pb) and MJCF (.xml) hold a whole robot and convert
into each other without loss. URDF (.urdf) holds the body only and is written, not
read. RoboGen's text (.txt) and JSON (.json) are read, not written. A packed robot
(.robot) holds its settings, too; ``schema.formats.packed`` writes it.
"""

import os
from pathlib import Path

from schema.errors import InvalidRobot, check_most, naming, unreadable
from schema.experiment.brains import types_of
from schema.experiment.document import Experiment, Fitness, Simulation, Space
from schema.experiment.settings import EvaluationSettings, evaluation_settings_of
from schema.formats.document import compose
from schema.formats.robogen_json import robot_from_robogen_json
from schema.formats.robogen_text import robot_from_robogen_text
from schema.formats.yaml import robot_to_yaml
from schema.formats.yaml_2016 import RevolveReader, is_of_revolve
from schema.formats.yaml_reader import Reader
from schema.limits import MOST_MJCF_BYTES, MOST_TEXT_BYTES
from schema.parts import BUILT_IN, BodySpace
from schema.plugins.bounded import read_bytes
from schema.robot.archive import PACKED, PROTOBUF, read_archive
from schema.robot.brain import NeuronKinds
from schema.robot.cpg import BUILT_IN_KINDS
from schema.robot.robot import Robot, check_number, check_robot
from schema.tables.replacement import replace_file
from schema.wire.protobuf import decode_robot, encode_robot


def robot_from_yaml(
    text: str, file: str, space: BodySpace, kinds: NeuronKinds = BUILT_IN_KINDS
) -> Robot:
    """Return the robot of a YAML text, in the current form or that of Revolve (2016).

    Raises:
        InvalidRobot: no well-formed robot; the message names file, line and field.
    """
    document = compose(text, file)
    if not is_of_revolve(document):
        return Reader(space, file, kinds).read(document)
    try:
        return RevolveReader(space, file, kinds).read(document)
    except InvalidRobot as error:
        forms = "read in the form of the original Revolve; a file that begins with"
        own = "'revolve_robot: 1' has this project's form"
        raise InvalidRobot(f"{error} ({forms} {own})") from None


BEST = "best.yaml"
"""Name of the file of the best robot of a run's last population, in its folder."""
MJCF_ENDING = ".xml"
_MOST_BEST = 4
"""Most files of best robots that a message names."""
_YAML = (".yaml", ".yml")
_ROBOGEN = (".txt", ".json")
_READ = (*_YAML, *_ROBOGEN, ".pb", MJCF_ENDING, PACKED)
_WRITTEN = (".yaml", ".yml", ".pb", MJCF_ENDING, ".urdf")
_BINARY_DUMP = """a binary RoboGen dump (Protobuf) is not supported: \
only RoboGen's robot text and JSON are"""
_ANY_BUILT_IN = Space(part_types=(*Space().part_types, "schema.parts:LIGHT_SENSOR"))


def settings_of(experiment: Experiment | None) -> EvaluationSettings:
    """Return the evaluation settings of an experiment.

    None has the default values, with all built-in part types.
    """
    if experiment is None:
        return EvaluationSettings(
            space=_ANY_BUILT_IN, simulation=Simulation(), fitness=Fitness()
        )
    return evaluation_settings_of(experiment)


def types_for(settings: EvaluationSettings) -> tuple[BodySpace, NeuronKinds]:
    """Return the types of settings; the default ones have all built-in types."""
    if settings == settings_of(None):
        return BUILT_IN, BUILT_IN_KINDS
    return types_of(settings)


def check_file(path: Path) -> str:
    """Return the ending of the file of a robot, in lower case.

    Raises:
        InvalidRobot: another ending, a folder, or a missing file.
    """
    if path.is_dir():
        found = [path / BEST] if (path / BEST).is_file() else path.glob(f"*/{BEST}")
        best = ", ".join(map(str, sorted(found)[:_MOST_BEST]))
        hint = f"; the best robot of a run's last population is {best}" if best else ""
        raise InvalidRobot(f"{path}: must be the file of a robot, got a folder{hint}")
    ending = _ending(path, _READ)
    try:
        path.stat()
    except OSError as error:
        raise InvalidRobot(f"{path}: {unreadable(error)}") from None
    return ending


def read_robot(
    path: Path, space: BodySpace = BUILT_IN, kinds: NeuronKinds = BUILT_IN_KINDS
) -> Robot:
    """Return the robot of a file.

    Raises:
        InvalidRobot: another ending, a folder, a file that cannot be read, a text that
            is not a robot, or a robot that is not well formed in this body space.
        MalformedMessage: a .pb file, or such bytes in a packed robot, that hold none.
    """
    ending = check_file(path)
    if ending in _YAML:
        return robot_from_yaml(_text(path, ending), str(path), space, kinds)
    if ending in _ROBOGEN:
        text = _text(path, ending)
        # The content decides: either form may have either ending.
        is_json = text.lstrip()[:1] == "{" or (ending == ".json" and text[:1] != "0")
        read = robot_from_robogen_json if is_json else robot_from_robogen_text
        robot = read(text, str(path), space)
    elif ending == MJCF_ENDING:
        # MuJoCo is imported only if needed: it is slow to load.
        from schema.formats.mjcf import read_mjcf  # noqa: PLC0415

        robot, _ = read_mjcf(path)
    else:
        try:
            is_packed = ending == PACKED
            data = read_archive(path)[1][PROTOBUF] if is_packed else read_bytes(path)
        except OSError as error:
            raise InvalidRobot(f"{path}: {unreadable(error)}") from None
        with naming(path):
            robot = decode_robot(data)
    with naming(path):
        check_number(robot)
        check_robot(robot, space, kinds)
    return robot


def _text(path: Path, ending: str) -> str:
    """Return the text of a robot; RoboGen's binary dumps are refused by name."""
    try:
        # Editors of Windows begin a text with a mark of its encoding.
        return read_bytes(path).decode("utf-8-sig")
    except (OSError, UnicodeDecodeError) as error:
        is_dump = ending in _ROBOGEN and isinstance(error, UnicodeDecodeError)
        why = _BINARY_DUMP if is_dump else unreadable(error)
        raise InvalidRobot(f"{path}: {why}") from None


def write_robot(
    robot: Robot, path: Path, settings: EvaluationSettings | None = None
) -> None:
    """Write a robot to a file; a file that is there is replaced as a whole.

    The settings name its types, and are stored in MJCF; None: the default values, with
    all built-in types (in MJCF, those of the default brain).

    Raises:
        InvalidRobot: another ending, a robot that could not be read again, or no file.
    """
    ending = _ending(path, _WRITTEN)
    settings = settings or settings_of(None)
    with naming(path):
        check_number(robot)
        data = _written(robot, ending, settings)
    most = MOST_MJCF_BYTES if ending == MJCF_ENDING else MOST_TEXT_BYTES
    if ending in _READ:
        check_most(len(data), most, "bytes", str(path), InvalidRobot)
    write_bytes(path, data)


def write_bytes(path: Path, data: bytes) -> None:
    """Write the bytes of a robot file, as ``write_robot``."""
    try:
        # Where a link leads: the link itself stays.
        target = Path(os.path.realpath(path))
        if target.exists() and not target.is_file():
            target.write_bytes(data)  # a device or a pipe
        else:
            replace_file(target, lambda new: new.write_bytes(data))
    except OSError as error:
        raise InvalidRobot(f"{path}: cannot be written: {error.strerror}") from None


def _written(robot: Robot, ending: str, settings: EvaluationSettings) -> bytes:
    space, kinds = types_for(settings)
    if ending in _YAML:
        return robot_to_yaml(robot, space, kinds).encode()
    if ending == MJCF_ENDING:
        from schema.formats.mjcf import robot_to_mjcf  # noqa: PLC0415

        return robot_to_mjcf(robot, settings).encode()
    check_robot(robot, space, kinds)
    if ending == ".pb":
        return encode_robot(robot)
    from schema.formats.urdf import robot_to_urdf  # noqa: PLC0415

    return robot_to_urdf(robot, space, settings.simulation).encode()


def _ending(path: Path, endings: tuple[str, ...]) -> str:
    ending = path.suffix.lower()
    if ending == ".dat":
        raise InvalidRobot(f"{path}: {_BINARY_DUMP}")
    if ending not in endings:
        allowed = ", ".join(endings)
        how = " (robot pack writes it)" if ending == PACKED else ""
        raise InvalidRobot(f"{path}: must end in one of {allowed}, got {ending!r}{how}")
    return ending
