"""Decoded answers of workers that advance arenas, checked against their requests."""

from collections.abc import Callable, Mapping

import numpy as np
from msgspec import Struct, structs

from coordinator.islands.events import Advanced
from coordinator.parts.exchange import PartResult
from coordinator.run.advance_checks import (
    ExpectedAdvance,
    check_advance,
    check_poses,
    check_robots,
    printable_reasons,
)
from coordinator.run.requests import Expected, impossible, read_answer
from schema.errors import MalformedMessage
from schema.limits import ADVANCE_BYTES
from schema.robot.ids import BirthId
from schema.robot.results import Provenance
from schema.wire.arena import Advance, AdvanceShard, Box
from schema.wire.arena_state import ArenaState
from schema.wire.codec import decode
from schema.wire.messages import StateMissing
from schema.wire.poses import PoseArrays

_ROUNDING_M = 1e-3
"""Poses are of less precision than boxes [m]."""


class Reached(Struct, frozen=True):
    """A decoded answer to a request to advance a shard.

    Attributes:
        snapshot: the state that was reached; empty if it was not wanted.
    """

    event: Advanced
    snapshot: bytes


class PartReached(Struct, frozen=True):
    """A decoded answer to a request to advance a part of an arena."""

    result: PartResult
    provenance: Provenance


def read_advance(
    data: bytes,
    *,
    requested: AdvanceShard,
    job: Expected,
    is_whole: bool,
    repeats: Advanced | None,
    expected: ExpectedAdvance,
    provenance: Provenance,
    complete: Callable[[Advance], Advance] | None,
) -> Reached | None:
    """Return the decoded answer to a request; None if the worker lacks the state.

    ``repeats``: past result that the answer must have; None for a new advance.
    ``provenance``: of the answer, but for the time that it took. ``complete``: adds
    what a drift between platforms lost; None without a drift.

    Raises:
        MalformedMessage: no answer, the answer to another request, or one that
            contradicts the request or the state of the arena.
    """
    answer = _read(data, job, is_whole=is_whole)
    if answer is None:
        return None
    advance, wall_s = answer
    if complete is not None:
        advance = complete(advance)
    check_advance(advance, expected)
    rows = check_poses(advance, expected)
    if requested.wants_tracks:
        advance = with_tracks(advance, PoseArrays.received(advance.poses))
    if repeats is not None:
        _check_repeated(advance, rows, repeats)
    snapshot = advance.snapshot
    casualties = printable_reasons(advance.casualties)
    advance = structs.replace(advance, casualties=casualties, snapshot=b"")
    signed = structs.replace(provenance, wall_s=wall_s)
    event = Advanced(requested.island, requested.number, advance, rows, signed)
    return Reached(event, snapshot)


def with_tracks(advance: Advance, poses: PoseArrays) -> Advance:
    """Return an advance with the tracks of its living robots."""
    robots = [judgement.birth for judgement in advance.judgements]
    return structs.replace(advance, tracks=poses.tracks(robots).tobytes())


def _check_repeated(advance: Advance, rows: int, repeats: Advanced) -> None:
    """Raise ``MalformedMessage`` unless an advance has a past result."""
    got, must = (advance.digest, rows), (repeats.advance.digest, repeats.pose_rows)
    if got != must:
        raise MalformedMessage(
            f"advance to step {advance.step}: the digest of its state and its "
            f"number of poses must be {must[0].hex()[:16]}... and {must[1]}, got "
            f"{got[0].hex()[:16]}... and {got[1]}: this machine's results differ",
            "differs",
        )


def read_part(
    data: bytes,
    *,
    job: Expected,
    is_whole: bool,
    expected: ExpectedAdvance,
    provenance: Provenance,
) -> PartReached | None:
    """Return the decoded answer to a request; None if the worker lacks the state.

    Raises:
        MalformedMessage: no answer, the answer to another request, or one that
            contradicts the request, the state of the arena, or itself.
    """
    answer = _read(data, job, is_whole=is_whole)
    if answer is None:
        return None
    advance, wall_s = answer
    state = decode(ArenaState, advance.snapshot, ADVANCE_BYTES)
    if (state.step, state.digest) != (expected.until, advance.digest):
        raise impossible("part: the state must have the step and digest of the advance")
    if state.casualties:
        raise impossible("part: casualties must be reported")
    births = sorted(expected.living)
    counts = [len(advance.boxes), len(advance.costs)]
    if counts != [len(births)] * 2:
        raise impossible(f"part: must have {len(births)} boxes and costs, got {counts}")
    boxes = dict(zip(births, advance.boxes, strict=True))
    result = PartResult(
        structs.replace(
            advance,
            snapshot=b"",
            boxes=(),
            costs=(),
            casualties=printable_reasons(advance.casualties),
        ),
        state,
        boxes,
        dict(zip(births, advance.costs, strict=True)),
        dict(zip(state.births, advance.work_j, strict=False)),
    )
    check_robots(state.births, advance.casualties, expected.living)
    check_advance(result.advance, expected)
    check_poses(result.advance, expected)
    _check_places(result.advance, boxes)
    return PartReached(result, structs.replace(provenance, wall_s=wall_s))


def _check_places(advance: Advance, boxes: Mapping[BirthId, Box]) -> None:
    """Raise ``MalformedMessage`` if a robot is outside of its box."""
    poses = PoseArrays.received(advance.poses)
    swept = np.array([boxes[birth] for birth in poses.robots]).reshape(-1, 4)
    places = poses.cores[:, :2]
    is_outside = (places < swept[:, :2] - _ROUNDING_M).any(axis=1)
    is_outside |= (places > swept[:, 2:] + _ROUNDING_M).any(axis=1)
    if is_outside.any():
        robot = poses.robots[int(is_outside.argmax())]
        raise impossible(f"part: robot {robot.name} must be in the box that it swept")


def _read(
    data: bytes, job: Expected, *, is_whole: bool
) -> tuple[Advance, float] | None:
    """Return an advance and the time that it took; None if the state is missing."""
    answer = read_answer(data, job, Advance | StateMissing, ADVANCE_BYTES)
    if isinstance(answer.result, Advance):
        return answer.result, answer.wall_s
    if is_whole:
        raise impossible("answer: lacks the state that came with the request")
    return None
