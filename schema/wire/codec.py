"""Protobuf bytes of robots, genomes, requests and answers, sent and stored.

Encoding is deterministic: equal values give equal bytes. Decoding checks the type and
the rules of a message and raises ``MalformedMessage`` otherwise. Rules that need the
part types or neuron types are checked by ``schema.robot.robot.check_robot``.
"""

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

from schema.errors import NO_MESSAGE, MalformedMessage
from schema.experiment.identity import NO_IDENTITY, Identity
from schema.limits import (
    ADVANCE_REQUEST_BYTES,
    ANSWER_BYTES,
    LONGEST_REASON,
    MOST_PARTS,
    PAIR_BYTES,
    REQUEST_BYTES,
    ROBOT_BYTES,
    printable,
)
from schema.robot.genome import Genome
from schema.robot.results import Evaluation, Report
from schema.robot.robot import Robot
from schema.wire import revolve_pb2 as pb
from schema.wire.decoding import parsed, require_most
from schema.wire.messages import (
    body_from_message,
    body_to_message,
    finite,
    genome_from_message,
    genome_to_message,
    identity_from_message,
    identity_to_message,
    read_wall_s,
    robot_from_message,
    vector_from_message,
    write_brain,
)

_MOST_PAIRS = MOST_PARTS * (MOST_PARTS - 1) // 2


@dataclass(frozen=True, slots=True)
class Request:
    """Request to an analyzer or a worker; its answer depends on nothing else.

    Attributes:
        run: name of the run.
        epoch: incarnation of the coordinator of the run.
        number: of the job, unique within the epoch.
        settings: JSON of ``VettingSettings`` or ``EvaluationSettings``.
        robot: the robot; for an analyzer, its body alone.
        steps: physics steps to simulate; 0 takes those of the settings.
        identity: of the evaluation; ``NO_IDENTITY`` for an analyzer.
    """

    run: str
    epoch: int
    number: int
    settings: bytes
    robot: Robot
    steps: int = 0
    identity: Identity = NO_IDENTITY


@dataclass(frozen=True, slots=True)
class Answer:
    """Answer to a request.

    Attributes:
        epoch, number: of the request.
        wall_s: duration by the clock [s]; information only.
        result: of the job; a text is the reason of a failed simulation.
    """

    epoch: int
    number: int
    wall_s: float
    result: Report | Evaluation | str


def encode_robot(robot: Robot) -> bytes:
    """Return the bytes of a robot: those of its body, then those of its brain.

    Protobuf messages can be concatenated, so each part can be used alone.
    """
    return encode_body(robot) + encode_brain(robot)


def encode_body(robot: Robot) -> bytes:
    """Return the bytes of a robot without its brain."""
    message = body_to_message(robot.parts)
    return message.SerializeToString(deterministic=True)


def encode_brain(robot: Robot) -> bytes:
    """Return the bytes of a robot's brain, the second part of its bytes."""
    message = pb.Robot()
    write_brain(robot.brain, message)
    return message.SerializeToString(deterministic=True)


def decode_robot(data: bytes) -> Robot:
    """Return the robot of some bytes.

    Raises:
        MalformedMessage: not a robot's bytes, parts that are not a tree, or a brain
            that breaks its rules.
    """
    return robot_from_message(parsed(data, pb.Robot(), ROBOT_BYTES))


def decode_body(data: bytes) -> Robot:
    """Return an encoded robot as a robot without brain.

    Raises:
        MalformedMessage: not a robot's bytes, or parts that are not a tree.
    """
    return Robot(body_from_message(parsed(data, pb.Robot(), ROBOT_BYTES)))


def encode_genome(genome: Genome) -> bytes:
    """Return the bytes of a genome."""
    message = genome_to_message(genome)
    return message.SerializeToString(deterministic=True)


def decode_genome(data: bytes) -> Genome:
    """Return the genome of some bytes.

    Raises:
        MalformedMessage: not a genome's bytes, nodes that are not a tree, an unknown
            layer, a number that is not finite.
    """
    return genome_from_message(parsed(data, pb.Genome(), ROBOT_BYTES))


def encode_request(
    *,
    run: str,
    epoch: int,
    number: int,
    settings: bytes,
    robot: bytes,
    steps: int = 0,
    identity: Identity = NO_IDENTITY,
    plugins: str = "",
) -> bytes:
    """Return the bytes of a request.

    ``robot`` holds encoded bytes of the robot or its body; ``plugins`` is the result
    of ``source.plugins_of`` for the settings.
    """
    message = pb.Request(
        run=run,
        epoch=epoch,
        number=number,
        settings=settings,
        robot=robot,
        steps=steps,
        plugins=plugins,
    )
    if identity is not NO_IDENTITY:
        message.identity.CopyFrom(identity_to_message(identity))
    return message.SerializeToString(deterministic=True)


def decode_request(
    data: bytes,
    read: Callable[[bytes], Robot] = decode_robot,
    prepare: Callable[[bytes], object] | None = None,
) -> Request:
    """Return the request of some bytes.

    Args:
        data: the bytes.
        read: decodes its robot; ``decode_body`` skips the brain.
        prepare: called with the settings before the robot is decoded, to load the
            plug-ins that they name.

    Raises:
        MalformedMessage: not a request's bytes, or its robot is malformed.
        RevolveError: raised by ``prepare``.
    """
    message = parsed(data, pb.Request(), REQUEST_BYTES)
    if prepare is not None:
        prepare(message.settings)
    has_identity = message.HasField("identity")
    return Request(
        run=message.run,
        epoch=message.epoch,
        number=message.number,
        settings=message.settings,
        robot=read(message.robot),
        steps=message.steps,
        identity=identity_from_message(message.identity)
        if has_identity
        else NO_IDENTITY,
    )


def request_kind(data: bytes) -> Literal["advance", "call", "evaluation"]:
    """Return what a worker is asked for: to advance an arena, a call, an evaluation.

    Raises:
        MalformedMessage: bytes that are no request of any kind.
    """
    # Only a request about an arena has changes, even if they are empty.
    arena = parsed(data, pb.AdvanceRequest(), ADVANCE_REQUEST_BYTES)
    if arena.HasField("changes"):
        return "advance"
    request = parsed(data, pb.Request(), REQUEST_BYTES)
    return "call" if request.HasField("call") else "evaluation"


def encode_answer(answer: Answer) -> bytes:
    """Return the bytes of an answer; the reason of a failure is cut."""
    message = pb.Answer(epoch=answer.epoch, number=answer.number, wall_s=answer.wall_s)
    if isinstance(answer.result, Report):
        write_report(answer.result, message.report)
    elif isinstance(answer.result, Evaluation):
        message.evaluation.CopyFrom(evaluation_to_message(answer.result))
    else:
        message.failure = printable(answer.result, LONGEST_REASON)
    return message.SerializeToString(deterministic=True)


def decode_answer(data: bytes, pairs: int = _MOST_PAIRS) -> Answer:
    """Return the answer of some bytes; the reason of a failure is cut.

    Args:
        data: the bytes.
        pairs: number of intersections that a report may have.

    Raises:
        MalformedMessage: not an answer's bytes, too many of them, no result, a number
            that is not finite, a negative duration.
    """
    message = parsed(data, pb.Answer(), ANSWER_BYTES + pairs * PAIR_BYTES)
    result: Report | Evaluation | str
    match message.WhichOneof("result"):
        case "report":
            require_most(len(message.report.intersections), pairs, "intersections")
            result = report_from_message(message.report)
            if result.reason:
                reason = printable(result.reason, LONGEST_REASON)
                result = replace(result, reason=reason)
        case "evaluation":
            result = evaluation_from_message(message.evaluation)
        case "failure":
            result = printable(message.failure, LONGEST_REASON) or NO_MESSAGE
        case _:
            raise MalformedMessage("answer: has no result")
    return Answer(message.epoch, message.number, read_wall_s(message), result)


def write_report(report: Report, message: pb.Report) -> None:
    """Fill an empty message with a report; twice as fast as copying a message."""
    message.is_viable, message.reason = report.is_viable, report.reason
    for pair in report.intersections:
        entry = message.intersections.add()
        entry.first, entry.second = pair
    lower, upper = message.lower, message.upper
    lower.x, lower.y, lower.z = report.lower
    upper.x, upper.y, upper.z = report.upper
    message.mass, message.motors = report.mass, report.motors


def report_from_message(message: pb.Report) -> Report:
    """Return the report of a message.

    Raises:
        MalformedMessage: a viable body with a reason, a missing corner, a number that
            is not finite.
    """
    if message.is_viable and message.reason:
        raise MalformedMessage(
            f"report: a viable body must have no reason, got {message.reason!r}"
        )
    if not (message.HasField("lower") and message.HasField("upper")):
        raise MalformedMessage("report: must have both corners of the body")
    return Report(
        is_viable=message.is_viable,
        reason=message.reason,
        intersections=tuple(
            (pair.first, pair.second) for pair in message.intersections
        ),
        lower=vector_from_message(message.lower, "report.lower"),
        upper=vector_from_message(message.upper, "report.upper"),
        mass=finite(message.mass, "report.mass"),
        motors=message.motors,
    )


def evaluation_to_message(evaluation: Evaluation) -> pb.Evaluation:
    """Return an evaluation as a message."""
    # Not by ``asdict``: it copies each value, at a tenth of an evaluation's cost here.
    return pb.Evaluation(
        fitness=evaluation.fitness,
        path_velocity=evaluation.path_velocity,
        straight_velocity=evaluation.straight_velocity,
        simulated_s=evaluation.simulated_s,
        measures=evaluation.measures,
    )


def evaluation_from_message(message: pb.Evaluation) -> Evaluation:
    """Return the evaluation of a message.

    Raises:
        MalformedMessage: a number that is not finite.
    """
    return Evaluation(
        finite(message.fitness, "evaluation.fitness"),
        finite(message.path_velocity, "evaluation.path_velocity"),
        finite(message.straight_velocity, "evaluation.straight_velocity"),
        finite(message.simulated_s, "evaluation.simulated_s"),
        tuple(finite(each, "evaluation.measures") for each in message.measures),
    )
