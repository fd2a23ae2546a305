"""What the analyzer says of a body: how large, how heavy, may it live?"""

from analyzer.boxes import bounding_box, place_boxes
from analyzer.overlap import intersecting_parts
from schema.experiment.document import Vetting
from schema.parts import BodySpace
from schema.robot.results import Report
from schema.robot.robot import Robot


def analyze(robot: Robot, space: BodySpace, vetting: Vetting) -> Report:
    """Return the report on a body in its neutral pose.

    Args:
        robot: a checked robot.
        space: its part types.
        vetting: what counts as intersecting.

    Returns:
        Intersections, bounding box, mass, motors; viable exactly if no two parts
        that do not sit on each other intersect and at least one motor is there.
    """
    boxes = place_boxes(robot, space)
    intersections = intersecting_parts(boxes, robot, vetting)
    motors = sum(space[part.kind].outputs for part in robot.parts)
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
    """Return in words why a body may not live; nothing if it may."""
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
