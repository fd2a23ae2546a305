"""Check that the births of a run folder are of the encoding that the run uses now."""

from pathlib import Path

import pyarrow.compute as pc

from coordinator.evolution.encodings import encoding_of
from schema.errors import InvalidRobot, RunFolderError
from schema.experiment.document import REVOLVE_ANGLE, Experiment
from schema.robot.robot import Robot
from schema.tables.files import read_table
from schema.wire.protobuf import decode_robot, encode_robot


def check_stored_genomes(folder: Path, experiment: Experiment) -> None:
    """Raise if the encoding develops another robot from the first stored genome.

    An own encoding may have changed since the run was stopped; its next births would
    not belong to those in the folder. The thesis's encoding is not checked.

    Raises:
        RunFolderError: it does, or cannot read the genome.
    """
    if experiment.encoding.type == REVOLVE_ANGLE:
        return
    names = ["record", "birth", "genome", "robot"]
    births = read_table(folder, "births", names, pc.field("record") == 0).to_pylist()
    if not births:
        return
    row, encoding = births[0], encoding_of(experiment)
    try:
        robot = encoding.develop(encoding.from_bytes(row["genome"]))
        problem = "develops into another robot now"
    except InvalidRobot as error:
        robot, problem = None, str(error)
    if robot is None or not _is_same(robot, row["robot"], experiment):
        raise RunFolderError(
            f"{folder}: the genome of birth {row['birth']} was written by another "
            f"encoding than {encoding.name!r} is now: {problem}; restore its code, or "
            "start a new run"
        )


def _is_same(robot: Robot, stored: bytes, experiment: Experiment) -> bool:
    """Return whether a stored robot has developed from the genome of a robot."""
    if experiment.learning or any(each.learning for each in experiment.islands):
        return decode_robot(stored).parts == robot.parts
    return encode_robot(robot) == stored
