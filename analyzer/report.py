"""Report on a body (size, mass, motors, intersections), also as an encoded answer."""

import time
from functools import lru_cache

from analyzer.overlap import bounding_box, intersecting_parts, place_boxes
from schema.experiment.document import Vetting, body_space
from schema.experiment.settings import read_vetting_settings
from schema.parts import BodySpace
from schema.robot.results import Report
from schema.robot.robot import Robot, check_body, motor_count
from schema.wire.codec import Answer, decode_body, decode_request, encode_answer


def answer(request: bytes) -> bytes:
    """Return the encoded answer to an encoded request.

    Args:
        request: a ``Request`` with ``VettingSettings`` about a body; a brain in it is
            ignored.

    Returns:
        An ``Answer`` with a report; apart from ``wall_s`` it depends on the request
        alone.

    Raises:
        MalformedMessage: the bytes are no request.
        ExperimentError: the settings are invalid or name what does not exist.
        InvalidRobot: the body space does not allow the body.
    """
    start = time.perf_counter()
    decoded = decode_request(request, decode_body, _body_space)
    settings = read_vetting_settings(decoded.settings)
    space = _body_space(decoded.settings)
    check_body(decoded.robot.parts, space)
    report = analyze(decoded.robot, space, settings.vetting)
    wall_s = time.perf_counter() - start
    return encode_answer(Answer(decoded.epoch, decoded.number, wall_s, report))


@lru_cache(maxsize=64)
def _body_space(settings: bytes) -> BodySpace:
    return body_space(read_vetting_settings(settings).space)


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
