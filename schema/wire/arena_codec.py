"""Protobuf bytes of requests to advance arena shards, and of their answers."""

from collections.abc import Callable
from dataclasses import dataclass, replace

from schema.errors import NO_MESSAGE, MalformedMessage
from schema.limits import (
    ADVANCE_BYTES,
    ADVANCE_REQUEST_BYTES,
    LIVE_BYTES,
    LONGEST_REASON,
    printable,
)
from schema.robot.ids import BirthId
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
from schema.wire.decoding import parsed
from schema.wire.messages import (
    birth_from_message,
    birth_to_message,
    finite,
    read_brain,
    read_wall_s,
    robot_from_message,
    robot_to_message,
    vector_from_message,
    vector_to_message,
    write_brain,
)

_DIGEST_BYTES = 32


@dataclass(frozen=True, slots=True)
class PastAdvance:
    """Past advance to repeat: its changes, last step, and digest of the result."""

    changes: Changes
    until: int
    digest: bytes


@dataclass(frozen=True, slots=True)
class Rebuild:
    """Data to rebuild the state of a shard.

    Attributes:
        snapshot: of the shard; empty for an arena before its first advance.
        history: advances since the snapshot, oldest first.
        living: robots that must live at the end, if the advances ran on another
            platform, where results may differ.
    """

    snapshot: bytes
    history: tuple[PastAdvance, ...]
    living: tuple[BirthId, ...] | None = None


@dataclass(frozen=True, slots=True)
class AdvanceRequest:
    """Request to advance a shard; its answer depends on nothing else.

    Attributes:
        run: name of the run.
        epoch: incarnation of the coordinator of the run.
        number: of the job, unique within the epoch.
        settings: JSON of ``ArenaSettings``.
        shard: number of the arena's island.
        from_step: step at which the advance starts.
        from_digest: of the state at that step; empty before the first advance.
        changes: made before the advance.
        until: step at which the advance ends.
        wants_snapshot: the answer must hold the state at the end.
        rebuild: data to rebuild the state at the start; None for a worker that
            holds it.
    """

    run: str
    epoch: int
    number: int
    settings: bytes
    shard: int
    from_step: int
    from_digest: bytes
    changes: Changes
    until: int
    wants_snapshot: bool
    rebuild: Rebuild | None = None


@dataclass(frozen=True, slots=True)
class AdvanceAnswer:
    """Answer to a request to advance a shard.

    Attributes:
        epoch, number: of the request.
        wall_s: duration by the clock [s]; information only.
        advance: the result; None if the worker has neither the state at the start
            nor data to rebuild it.
        snapshot: state at the end; empty if not wanted.
    """

    epoch: int
    number: int
    wall_s: float
    advance: Advance | None
    snapshot: bytes = b""


@dataclass(frozen=True, slots=True)
class Live:
    """Message to viewers after each advance, published best effort.

    Attributes:
        run: name of the run.
        shard: number of the arena's island.
        advance: the result, poses included.
    """

    run: str
    shard: int
    advance: Advance


def encode_advance_request(request: AdvanceRequest, plugins: str = "") -> bytes:
    """Return the bytes of a request.

    ``plugins`` is the result of ``source.plugins_of`` for its settings.
    """
    message = pb.AdvanceRequest(
        run=request.run,
        epoch=request.epoch,
        number=request.number,
        settings=request.settings,
        shard=request.shard,
        from_step=request.from_step,
        from_digest=request.from_digest,
        changes=changes_to_message(request.changes),
        until=request.until,
        wants_snapshot=request.wants_snapshot,
        plugins=plugins,
    )
    if request.rebuild is not None:
        message.is_rebuild = True
        message.snapshot = request.rebuild.snapshot
        for past in request.rebuild.history:
            message.history.add(
                changes=changes_to_message(past.changes),
                until=past.until,
                digest=past.digest,
            )
        if request.rebuild.living is not None:
            message.is_drift = True
            message.living.extend(map(birth_to_message, request.rebuild.living))
    return message.SerializeToString(deterministic=True)


def decode_advance_request(
    data: bytes, prepare: Callable[[bytes], object] | None = None
) -> AdvanceRequest:
    """Return the request of some bytes.

    Args:
        data: the bytes.
        prepare: as for ``decode_request``.

    Raises:
        MalformedMessage: not a request's bytes, a robot or a brain that breaks its
            rules, a digest of wrong length, an end before the start, a number that
            is not finite.
        RevolveError: raised by ``prepare``.
    """
    message = parsed(data, pb.AdvanceRequest(), ADVANCE_REQUEST_BYTES)
    if prepare is not None:
        prepare(message.settings)
    if message.until < message.from_step:
        raise MalformedMessage(
            f"until: must be >= from_step = {message.from_step}, got {message.until}"
        )
    living = tuple(map(birth_from_message, message.living))
    rebuild = Rebuild(
        message.snapshot,
        tuple(map(_past, message.history)),
        living if message.is_drift else None,
    )
    if not message.is_rebuild and rebuild != Rebuild(b"", ()):
        raise MalformedMessage("advance: snapshot and history need is_rebuild")
    return AdvanceRequest(
        run=message.run,
        epoch=message.epoch,
        number=message.number,
        settings=message.settings,
        shard=message.shard,
        from_step=message.from_step,
        from_digest=checked_digest(message.from_digest) if message.from_digest else b"",
        changes=changes_from_message(message.changes),
        until=message.until,
        wants_snapshot=message.wants_snapshot,
        rebuild=rebuild if message.is_rebuild else None,
    )


def encode_advance_answer(answer: AdvanceAnswer) -> bytes:
    """Return the bytes of an answer."""
    message = pb.AdvanceAnswer(
        epoch=answer.epoch,
        number=answer.number,
        wall_s=answer.wall_s,
        snapshot=answer.snapshot,
    )
    if answer.advance is None:
        message.needs_state = True
    else:
        message.advance.CopyFrom(advance_to_message(answer.advance))
    return message.SerializeToString(deterministic=True)


def decode_advance_answer(data: bytes, most: int = ADVANCE_BYTES) -> AdvanceAnswer:
    """Return the answer of some bytes; reasons are cut.

    Args:
        data: the bytes.
        most: number of bytes that it may have.

    Raises:
        MalformedMessage: not an answer's bytes, too many of them, no result, a digest
            of wrong length, a number that is not finite, a negative duration.
    """
    message = parsed(data, pb.AdvanceAnswer(), most)
    result = message.WhichOneof("result")
    if result is None or (result == "needs_state" and not message.needs_state):
        raise MalformedMessage("answer: must hold an advance or need a state")
    advance: Advance | None = None
    if result == "advance":
        advance = advance_from_message(message.advance)
        fallen = tuple(
            replace(one, reason=printable(one.reason, LONGEST_REASON) or NO_MESSAGE)
            for one in advance.casualties
        )
        advance = replace(advance, casualties=fallen)
    return AdvanceAnswer(
        epoch=message.epoch,
        number=message.number,
        wall_s=read_wall_s(message),
        advance=advance,
        snapshot=message.snapshot,
    )


def encode_live(live: Live) -> bytes:
    """Return the bytes of a message to viewers."""
    message = pb.Live(run=live.run, shard=live.shard)
    message.advance.CopyFrom(advance_to_message(live.advance))
    return message.SerializeToString(deterministic=True)


def decode_live(data: bytes) -> Live:
    """Return the message to viewers of some bytes.

    Raises:
        MalformedMessage: other bytes, or an advance that breaks its rules.
    """
    message = parsed(data, pb.Live(), LIVE_BYTES)
    return Live(message.run, message.shard, advance_from_message(message.advance))


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


def _past(message: pb.PastAdvance) -> PastAdvance:
    changes = changes_from_message(message.changes)
    return PastAdvance(changes, message.until, checked_digest(message.digest))


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
