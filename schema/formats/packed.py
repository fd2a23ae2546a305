"""Packed robots: what they hold for an evaluation, written, read and allowed."""

from pathlib import Path

from schema.errors import ExperimentError, InvalidRobot, check_most, one_line
from schema.experiment.brains import types_of
from schema.experiment.document import Experiment, references
from schema.experiment.file import experiment_from_text, experiment_text
from schema.experiment.settings import evaluation_settings, read_evaluation_settings
from schema.formats.yaml import robot_to_yaml
from schema.limits import MOST_BRACKETS, MOST_SETTINGS_BYTES
from schema.plugins.kept import named_files
from schema.plugins.permission import FLAG, allow_references
from schema.plugins.source import digest_in_use, digest_of, modules_named
from schema.robot import archive
from schema.robot.archive import RobotOrigin
from schema.robot.robot import Robot, check_number
from schema.wire.protobuf import encode_robot


def packed_robot(
    robot: Robot, experiment: Experiment, picture: bytes, origin: RobotOrigin | None
) -> bytes:
    """Return a file with a robot and all that its evaluation needs.

    Of plug-ins that a run folder does not copy, it has the digest only. The experiment
    has the settings of one island; the picture is a PNG.

    Raises:
        InvalidRobot: not well formed, or too large to be read again.
        ExperimentError: the source of a plug-in cannot be read.
    """
    types = types_of(experiment)
    check_number(robot)
    text = experiment_text(experiment)
    plugins = named_files(text)
    members = {
        archive.YAML: robot_to_yaml(robot, *types).encode(),
        archive.PROTOBUF: encode_robot(robot),
        archive.SETTINGS: text.encode(),
        archive.PICTURE: picture,
    }
    for files in plugins.values():
        members |= {archive.SOURCES + name: data for name, data in files.items()}
    digests = {name: digest_of(name) for name in plugins}
    return archive.archive_bytes(members, digests, origin)


def packed_experiment(path: Path) -> Experiment:
    """Return the experiment in a packed robot, if its plug-ins are in use here.

    Raises:
        InvalidRobot: no packed robot, one that was changed, or other settings.
        ExperimentError: its plug-ins are not allowed, or are other ones here.
    """
    contents, members = archive.read_archive(path)
    data, where = members[archive.SETTINGS], f"{path}: {archive.SETTINGS}"
    brackets = data.count(b"[") + data.count(b"{")
    check_most(len(data), MOST_SETTINGS_BYTES, "bytes", where, InvalidRobot)
    check_most(brackets, MOST_BRACKETS, "lists and tables", where, InvalidRobot)
    try:
        experiment = experiment_from_text(data.decode())
        read_evaluation_settings(evaluation_settings(experiment))
    except (ExperimentError, UnicodeDecodeError) as error:
        raise InvalidRobot(f"{where}: {one_line(error)}") from None
    for name in modules_named(experiment_text(experiment).encode()):
        digest, own = contents.plugins.get(name, ""), digest_in_use(name)
        if not own or own != digest:
            what = f"has source digest {own}" if own else "is not allowed"
            why = f"{what}, but {path} was made with {digest}; an import runs its code"
            how = f"add {FLAG} {path} (in Python: revolve.allow, in a new process)"
            if not any(each.startswith(archive.SOURCES + name) for each in members):
                how = f"install that version, which is not in it, and add {FLAG} {name}"
            raise ExperimentError(f"plug-in {name}: {why}: if you trust it, {how}")
    allow_references(references(experiment))
    return experiment
