"""Bytes of what goes to the holder of an arena shard, and of what comes back."""

from dataclasses import dataclass

from schema.errors import MalformedMessage
from schema.robot.ids import BirthId
from schema.wire import revolve_pb2 as pb
from schema.wire.arena import Advance, Changes
from schema.wire.arena_messages import (
    DIGEST_BYTES,
    advance_from_message,
    advance_to_message,
    birth_from_message,
    birth_to_message,
    changes_from_message,
    changes_to_message,
)
from schema.wire.messages import finite, parsed


@dataclass(frozen=True, slots=True)
class PastAdvance:
    """An advance to be done again: the changes before it, and what it came to."""

    changes: Changes
    until: int
    digest: bytes


@dataclass(frozen=True, slots=True)
class Rebuild:
    """Where a shard's state comes from when its holder is lost.

    Attributes:
        snapshot: of the shard; empty for an arena in which nothing has happened.
        history: the advances since, oldest first.
        living: who must be there at the end, if all this happened on another
            platform: what comes of it here need not be the same.
    """

    snapshot: bytes
    history: tuple[PastAdvance, ...]
    living: tuple[BirthId, ...] | None = None


@dataclass(frozen=True, slots=True)
class AdvanceRequest:
    """A request to advance a shard; its answer depends on nothing else.

    Attributes:
        run: name of the run that it belongs to.
        epoch: incarnation of the run's coordinator.
        number: of the job, unique within the epoch.
        settings: JSON of ``ArenaSettings``.
        shard: number of the island whose arena it is.
        from_step: where the shard must stand.
        from_digest: of its state there; empty if nothing has happened yet.
        changes: what is done first.
        until: the step to reach.
        wants_snapshot: the answer is to hold the state that was reached.
        rebuild: how to come to the state to start from, None for a worker that
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
    """The answer to such a request.

    Attributes:
        epoch, number: of the request.
        wall_s: how long it took [s]; never decides anything.
        advance: what it came to; None where the worker does not hold the state to
            start from and was not told how to rebuild it.
        snapshot: the state that was reached; empty if it was not wanted.
    """

    epoch: int
    number: int
    wall_s: float
    advance: Advance | None
    snapshot: bytes = b""


@dataclass(frozen=True, slots=True)
class Live:
    """What is published after each advance, best effort, for those who watch.

    Attributes:
        run: name of the run.
        shard: number of the island whose arena it is.
        advance: what it came to, poses included.
    """

    run: str
    shard: int
    advance: Advance


def encode_advance_request(request: AdvanceRequest, plugins: str = "") -> bytes:
    """Return the bytes of a request.

    ``plugins`` is what ``plugin_source.plugins_of`` says of its settings.
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


def decode_advance_request(data: bytes) -> AdvanceRequest:
    """Return the request of some bytes.

    Raises:
        MalformedMessage: not a request's bytes, a robot or a brain that breaks its
            rules, a digest that is none, an advance that goes back, a number that
            is not finite.
    """
    return _request(parsed(data, pb.AdvanceRequest()))


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


def decode_advance_answer(data: bytes) -> AdvanceAnswer:
    """Return the answer of some bytes.

    Raises:
        MalformedMessage: not an answer's bytes, no result in it, a digest that is
            none, a number that is not finite.
    """
    return _answer(parsed(data, pb.AdvanceAnswer()))


def encode_live(live: Live) -> bytes:
    """Return the bytes of what is published after an advance."""
    message = pb.Live(run=live.run, shard=live.shard)
    message.advance.CopyFrom(advance_to_message(live.advance))
    return message.SerializeToString(deterministic=True)


def decode_live(data: bytes) -> Live:
    """Return what was published after an advance.

    Raises:
        MalformedMessage: other bytes, or an advance that breaks its rules.
    """
    return _live(parsed(data, pb.Live()))


def _live(message: pb.Live) -> Live:
    return Live(message.run, message.shard, advance_from_message(message.advance))


def _request(message: pb.AdvanceRequest) -> AdvanceRequest:
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
        raise MalformedMessage("advance: a state to rebuild, and no word to do so")
    return AdvanceRequest(
        run=message.run,
        epoch=message.epoch,
        number=message.number,
        settings=message.settings,
        shard=message.shard,
        from_step=message.from_step,
        from_digest=_digest(message.from_digest) if message.from_digest else b"",
        changes=changes_from_message(message.changes),
        until=message.until,
        wants_snapshot=message.wants_snapshot,
        rebuild=rebuild if message.is_rebuild else None,
    )


def _past(message: pb.PastAdvance) -> PastAdvance:
    changes = changes_from_message(message.changes)
    return PastAdvance(changes, message.until, _digest(message.digest))


def _answer(message: pb.AdvanceAnswer) -> AdvanceAnswer:
    result = message.WhichOneof("result")
    if result is None or (result == "needs_state" and not message.needs_state):
        raise MalformedMessage("answer: holds no advance, and needs no state")
    return AdvanceAnswer(
        epoch=message.epoch,
        number=message.number,
        wall_s=finite(message.wall_s, "answer.wall_s"),
        advance=(
            advance_from_message(message.advance) if result == "advance" else None
        ),
        snapshot=message.snapshot,
    )


def _digest(data: bytes) -> bytes:
    if len(data) != DIGEST_BYTES:
        raise MalformedMessage(f"digest: must be {DIGEST_BYTES} bytes, got {len(data)}")
    return data
