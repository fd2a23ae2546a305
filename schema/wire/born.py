"""Robot of a row of the births table, and the point at which it was born."""

from collections.abc import Mapping
from typing import Any

from schema.errors import RunFolderError
from schema.experiment.document import REVOLVE_ANGLE, Experiment, body_space
from schema.robot.genome import develop
from schema.robot.robot import Robot, check_types
from schema.wire.protobuf import decode_genome, decode_robot


def robot_of_birth(genome: bytes, robot: bytes | None, experiment: Experiment) -> Robot:
    """Return the robot that was born.

    ``robot``: column of that name; null in runs of the encoding ``revolve-angle``.

    Raises:
        MalformedMessage: invalid bytes.
        InvalidRobot: the robot does not fit the part types of the experiment.
        RunFolderError: neither a robot nor a genome of ``revolve-angle``.
    """
    types = body_space(experiment.space)
    if robot is not None:
        found = decode_robot(robot)
        check_types(found, types)
        return found
    if experiment.encoding.type != REVOLVE_ANGLE:
        raise RunFolderError(
            f"births: a genome of encoding {experiment.encoding.type!r} has no robot "
            f"beside it, and only genomes of {REVOLVE_ANGLE!r} can be read here"
        )
    return develop(decode_genome(genome), types)


def birth_point(row: Mapping[str, Any]) -> float:
    """Return the point of a birth in the changes of its island.

    ``row`` of the births table: an arena's has a time [s], another one the number.
    """
    time_s: float | None = row.get("sim_time_s")
    return row["birth"] if time_s is None else time_s
