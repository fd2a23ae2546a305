"""Report on a body: size, mass, motors, intersections."""

from functools import lru_cache

from analyzer.overlap import bounding_box, intersecting_parts, place_boxes
from schema.errors import MalformedMessage
from schema.experiment.document import Vetting, body_space
from schema.experiment.settings import VettingSettings, read_vetting_settings
from schema.parts import BodySpace
from schema.robot.results import Report
from schema.robot.robot import Robot, check_body, check_tree, motor_count
from schema.wire.messages import Request, Vet


def answer(request: Request) -> Report:
    """Return the report on the body of a request; a brain in it is ignored.

    Args:
        request: a ``Vet`` with ``VettingSettings``.

    Raises:
        MalformedMessage: other work.
        ExperimentError: the settings are invalid or name what does not exist.
        InvalidRobot: the body space does not allow the body.
    """
    if not isinstance(request.work, Vet):
        raise MalformedMessage("an analyzer vets bodies only")
    settings, space = _read(request.settings)
    robot = request.work.robot
    check_tree(robot.parts)
    check_body(robot.parts, space)
    return analyze(robot, space, settings.vetting)


@lru_cache(maxsize=64)
def _read(settings: bytes) -> tuple[VettingSettings, BodySpace]:
    read = read_vetting_settings(settings)
    return read, body_space(read.space)


def analyze(robot: Robot, space: BodySpace, vetting: Vetting) -> Report:
    """Return the report on a body in its neutral pose.

    Args:
        robot: a checked robot.
        space: its part types.
        vetting: what counts as an intersection.

    Returns:
        Intersections, bounding box, mass, motors; viable exactly if no two parts
        that are not attached to each other intersect and it has a motor.
    """
    boxes = place_boxes(robot, space)
    intersections = intersecting_parts(boxes, robot, vetting)
    motors = motor_count(robot, space)
    lower, upper = bounding_box(boxes)
    reason = _reason(robot, intersections, motors)
    return Report(
        is_viable=not reason,
        reason=reason,
        intersections=intersections,
        lower=lower,
        upper=upper,
        mass=boxes.mass,
        motors=motors,
    )


def _reason(
    robot: Robot, intersections: tuple[tuple[int, int], ...], motors: int
) -> str:
    """Return why a body is not viable; empty if it is."""
    if not motors:
        return "no part has a motor"
    if not intersections:
        return ""
    first, second = intersections[0]
    words = (
        f"parts {first} ({robot.parts[first].kind}) and "
        f"{second} ({robot.parts[second].kind}) intersect"
    )
    more = len(intersections) - 1
    return f"{words}, and {more} more pair{'s'[: more > 1]}" if more else words
