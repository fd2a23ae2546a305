"""Checks of vettings and evaluations against the requests that they answer.

An answer that passes is one that a correct agent may give. A wrong value that is
plausible is not found here; cross-checks find it.
"""

from collections.abc import Sequence
from itertools import pairwise

from schema.errors import MalformedMessage
from schema.limits import GREATEST_COORDINATE, GREATEST_MASS, GREATEST_VELOCITY
from schema.parts import BodySpace
from schema.robot.results import Evaluation, Report
from schema.robot.robot import Robot
from schema.wire.codec import Answer, decode_answer

_ROUNDING = 1e-9
"""Relative error that sums of distances may have."""

Expected = tuple[int, int]
"""Epoch and number of a job."""


def read_vetting(
    data: bytes, *, expected: Expected, robot: Robot, space: BodySpace
) -> Answer:
    """Return the decoded answer to a vetting.

    Args:
        data: bytes of the answer.
        expected: epoch and number of the job.
        robot: whose body is vetted.
        space: its part types.

    Raises:
        MalformedMessage: not an answer, the answer to another request, or a report
            that no such body has.
    """
    count = len(robot.parts)
    answer = decode_answer(data, count * (count - 1) // 2)
    check_job(answer.epoch, answer.number, expected)
    report = answer.result
    if isinstance(report, Evaluation):
        raise impossible("a vetting must give a report, got an evaluation")
    if isinstance(report, Report):
        _check_report(report, robot, space)
    return answer


def read_evaluation(
    data: bytes, *, expected: Expected, simulated_s: float, measures: int = 0
) -> Answer:
    """Return the decoded answer to an evaluation.

    Args:
        data: bytes of the answer.
        expected: epoch and number of the job.
        simulated_s: length of the evaluation [s].
        measures: number of measures.

    Raises:
        MalformedMessage: not an answer, the answer to another request, another length
            or number of measures, or velocities that are not possible.
    """
    answer = decode_answer(data, 0)
    check_job(answer.epoch, answer.number, expected)
    found = answer.result
    if isinstance(found, Report):
        raise impossible("an evaluation must give an evaluation, got a report")
    if isinstance(found, Evaluation):
        if found.simulated_s != simulated_s:
            raise impossible(
                f"evaluation: must take {simulated_s} s, got {found.simulated_s} s"
            )
        check_velocities(found.path_velocity, found.straight_velocity)
        check_count(found.measures, measures)
    return answer


def check_job(epoch: int, number: int, expected: Expected) -> None:
    """Raise unless an answer belongs to a job.

    Raises:
        MalformedMessage: it belongs to another one.
    """
    if (epoch, number) != expected:
        raise MalformedMessage(
            f"answer must be to (epoch, job) {expected}, got {(epoch, number)}", "stale"
        )


def check_velocities(path: float, straight: float) -> None:
    """Raise unless a track can have these velocities [m/s].

    Raises:
        MalformedMessage: below 0, or a path shorter than the straight line.
    """
    if not (0.0 <= straight <= path * (1.0 + _ROUNDING) + _ROUNDING):
        raise impossible(
            "velocities: must be 0 <= straight <= path, got straight "
            f"{straight} m/s, path {path} m/s"
        )
    if path > GREATEST_VELOCITY:
        raise impossible(
            f"path velocity: must be <= {GREATEST_VELOCITY:g} m/s, got {path}"
        )


def check_count(measures: Sequence[float], wanted: int) -> None:
    """Raise unless there is one number for each measure of the experiment.

    Raises:
        MalformedMessage: another count.
    """
    if len(measures) != wanted:
        raise impossible(f"measures: must be {wanted} numbers, got {len(measures)}")


def _check_report(report: Report, robot: Robot, space: BodySpace) -> None:
    count = len(robot.parts)
    pairs = report.intersections
    are_parts = all(first < second < count for first, second in pairs)
    if not are_parts or any(a >= b for a, b in pairwise(pairs)):
        raise impossible(
            f"report: intersections must be ascending pairs of 0..{count - 1}"
        )
    motors = sum(space[part.kind].outputs for part in robot.parts)
    if report.motors != motors:
        raise impossible(f"report: motors must be {motors}, got {report.motors}")
    if report.is_viable == bool(pairs or not motors) or (
        not report.is_viable and not report.reason
    ):
        raise impossible(
            "report: a body is viable if no parts intersect and it has a motor, and "
            f"otherwise there is a reason; got {len(pairs)} intersections, {motors} "
            f"motors, viable {report.is_viable}, reason {report.reason!r}"
        )
    corners = (*report.lower, *report.upper)
    if any(low > high for low, high in zip(report.lower, report.upper, strict=True)):
        raise impossible(f"report: lower must be <= upper, got {corners}")
    if max(map(abs, corners)) > GREATEST_COORDINATE:
        raise impossible(f"report: corners must be finite positions, got {corners}")
    if not 0.0 < report.mass <= GREATEST_MASS:
        raise impossible(
            f"report: mass must be in (0, {GREATEST_MASS:g}] kg, got {report.mass}"
        )


def impossible(why: str) -> MalformedMessage:
    """Return the error of an answer that contradicts its request."""
    return MalformedMessage(why, "impossible")
