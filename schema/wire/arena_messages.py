"""Conversion of changes and advances of arenas to Protobuf messages and back.

``schema.wire.arena_codec`` encodes the messages.
"""

from schema.errors import MalformedMessage
from schema.limits import LONGEST_REASON, printable
from schema.wire import revolve_pb2 as pb
from schema.wire.arena import (
    Advance,
    BrainChange,
    Casualty,
    Changes,
    Insertion,
    Judgement,
    Touch,
)
from schema.wire.messages import (
    birth_from_message,
    birth_to_message,
    finite,
    read_brain,
    robot_from_message,
    robot_to_message,
    vector_from_message,
    vector_to_message,
    write_brain,
)

_DIGEST_BYTES = 32


def changes_to_message(changes: Changes) -> pb.Changes:
    """Return changes as a message."""
    message = pb.Changes(removals=map(birth_to_message, changes.removals))
    for each in changes.insertions:
        message.insertions.add(
            birth=birth_to_message(each.birth),
            robot=robot_to_message(each.robot),
            x=each.place[0],
            y=each.place[1],
            heading=each.heading,
        )
    for change in changes.brains:
        write_brain_change(change, message.brains.add())
    return message


def changes_from_message(message: pb.Changes) -> Changes:
    """Return the changes of a message.

    Raises:
        MalformedMessage: a robot or a brain that breaks its rules, a number that is
            not finite.
    """
    return Changes(
        removals=tuple(map(birth_from_message, message.removals)),
        insertions=tuple(map(_insertion, message.insertions)),
        brains=tuple(map(read_brain_change, message.brains)),
    )


def write_brain_change(change: BrainChange, message: pb.BrainChange) -> None:
    """Fill a message with a change of a brain."""
    message.birth.CopyFrom(birth_to_message(change.birth))
    write_brain(change.brain, message)
    message.restarts_window = change.restarts_window


def read_brain_change(message: pb.BrainChange) -> BrainChange:
    """Return the change of a brain of a message.

    The caller checks that the brain fits the robot.

    Raises:
        MalformedMessage: a brain that breaks its rules, or an unknown layer.
    """
    parts = 1 + max((neuron.part for neuron in message.neurons), default=0)
    return BrainChange(
        birth_from_message(message.birth),
        read_brain(message, parts),
        message.restarts_window,
    )


def advance_to_message(advance: Advance) -> pb.Advance:
    """Return an advance as a message, poses included."""
    message = pb.Advance(step=advance.step, digest=advance.digest, poses=advance.poses)
    for one in advance.judgements:
        message.judgements.add(
            birth=birth_to_message(one.birth),
            age_s=one.age_s,
            path_velocity=one.path_velocity,
            straight_velocity=one.straight_velocity,
            fitness=one.fitness,
            is_mature=one.is_mature,
            place=vector_to_message(one.place),
            measures=one.measures,
        )
    for fallen in advance.casualties:
        message.casualties.add(
            birth=birth_to_message(fallen.birth),
            step=fallen.step,
            reason=printable(fallen.reason, LONGEST_REASON),
            place=vector_to_message(fallen.place),
        )
    for touch in advance.touches:
        message.touches.add(
            first=birth_to_message(touch.first),
            second=birth_to_message(touch.second),
            duration_s=touch.duration_s,
        )
    return message


def advance_from_message(message: pb.Advance) -> Advance:
    """Return the advance of a message.

    Raises:
        MalformedMessage: a digest of wrong length, a number that is not finite.
    """
    return Advance(
        step=message.step,
        digest=checked_digest(message.digest),
        judgements=tuple(map(_judgement, message.judgements)),
        casualties=tuple(map(_casualty, message.casualties)),
        touches=tuple(map(_touch, message.touches)),
        poses=message.poses,
    )


def checked_digest(data: bytes) -> bytes:
    """Return a digest.

    Raises:
        MalformedMessage: a wrong length.
    """
    if len(data) != _DIGEST_BYTES:
        raise MalformedMessage(
            f"digest: must be {_DIGEST_BYTES} bytes, got {len(data)}"
        )
    return data


def _insertion(message: pb.Insertion) -> Insertion:
    return Insertion(
        birth_from_message(message.birth),
        robot_from_message(message.robot),
        (finite(message.x, "insertion.x"), finite(message.y, "insertion.y")),
        finite(message.heading, "insertion.heading"),
    )


def _judgement(message: pb.Judgement) -> Judgement:
    return Judgement(
        birth=birth_from_message(message.birth),
        age_s=finite(message.age_s, "judgement.age_s"),
        path_velocity=finite(message.path_velocity, "judgement.path_velocity"),
        straight_velocity=finite(
            message.straight_velocity, "judgement.straight_velocity"
        ),
        fitness=finite(message.fitness, "judgement.fitness"),
        is_mature=message.is_mature,
        place=vector_from_message(message.place, "judgement.place"),
        measures=tuple(finite(each, "judgement.measures") for each in message.measures),
    )


def _casualty(message: pb.Casualty) -> Casualty:
    return Casualty(
        birth_from_message(message.birth),
        message.step,
        message.reason,
        vector_from_message(message.place, "casualty.place"),
    )


def _touch(message: pb.Touch) -> Touch:
    return Touch(
        birth_from_message(message.first),
        birth_from_message(message.second),
        finite(message.duration_s, "touch.duration_s"),
    )
