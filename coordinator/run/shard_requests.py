"""Requests to advance the arena shards of a run, and their results.

The changes and advances since a shard's newest snapshot are kept, so that another
worker can rebuild its state. Nothing here decides what happens in an arena.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Protocol

from msgspec import structs

from coordinator.dispatch.events import AssignShard, Read, ShardFailed
from coordinator.dispatch.fleet import Fleet
from coordinator.islands.events import Advanced, AdvanceShard
from coordinator.run.advance_checks import (
    ExpectedAdvance,
    Inserted,
    check_advance,
    check_answer,
    inserted,
    place_poses,
    read_poses,
    restarted,
)
from coordinator.run.drift import Drift, with_losses
from coordinator.run.run_context import RunContext
from schema.errors import (
    JobRefused,
    MalformedMessage,
    RunFolderError,
    UnexpectedEvent,
)
from schema.experiment.document import body_space
from schema.parts import BodySpace, Vector
from schema.plugins.source import plugins_of
from schema.robot.ids import BirthId
from schema.robot.results import Provenance
from schema.wire.arena import Advance, Changes
from schema.wire.arena_codec import (
    AdvanceRequest,
    PastAdvance,
    Rebuild,
    decode_advance_answer,
    encode_advance_request,
)


class SnapshotStore(Protocol):
    """Storage of shard snapshots."""

    def has(self, shard: int, step: int, digest: bytes) -> bool:
        """Return whether there is a snapshot of this digest at a step."""

    def write(self, shard: int, step: int, data: bytes) -> None:
        """Store the state of a shard at a step, durably."""

    def read(self, shard: int, step: int) -> bytes:
        """Return the state of a shard at a step."""

    def drop_before(self, shard: int, step: int) -> None:
        """Remove the snapshots before a step."""


@dataclass(slots=True)
class _Past:
    """What has happened to a shard.

    Its state at ``step`` is that of the newest snapshot, at ``base`` (0 is the empty
    arena), after ``history``. ``platform`` is that of the last advance, empty before
    the first; ``places`` are those of the robots that lived after it, and ``born``
    their steps of insertion. The requested advance may have a snapshot in the store if
    ``may_be_kept``, as in any replay. It must have the result of ``repeats``, if there
    is one.
    """

    step: int = 0
    platform: str = ""
    digest: bytes = b""
    base: int = 0
    history: list[PastAdvance] = field(default_factory=list)
    places: dict[BirthId, Vector] = field(default_factory=dict)
    requested: AdvanceShard | None = None
    repeats: Advanced | None = None
    wants_snapshot: bool = False
    may_be_kept: bool = True
    born: dict[BirthId, Inserted] = field(default_factory=dict)

    def born_after(self, changes: Changes, space: BodySpace) -> dict[BirthId, Inserted]:
        """Return the robots that live after changes."""
        gone = set(changes.removals)
        born = {birth: at for birth, at in self.born.items() if birth not in gone}
        born |= {
            each.birth: inserted(each.robot, space, self.step)
            for each in changes.insertions
        }
        for birth in restarted(changes):
            born[birth] = replace(born[birth], window=self.step)
        return born

    def drifts_to(self, platform: str) -> bool:
        """Return whether a platform differs from that of the last advance."""
        return self.platform not in ("", platform)


@dataclass(frozen=True, slots=True)
class Reached:
    """A decoded answer to a request to advance a shard.

    Attributes:
        event: for the arena.
        snapshot: the state that was reached; empty if it was not wanted.
    """

    event: Advanced
    snapshot: bytes


class ShardRequests:
    """The advances of all arenas of a run."""

    def __init__(
        self, context: RunContext, snapshot_store: SnapshotStore, fleet: Fleet
    ) -> None:
        """Initialise without shards; ``fleet`` has the workers."""
        self._context = context
        self._snapshot_store = snapshot_store
        self._fleet = fleet
        self._pasts: dict[int, _Past] = {}
        # A shard has its island's number here and another one in the fleet.
        self._numbers: dict[int, int] = {}
        self._islands: dict[int, int] = {}
        self._repeated_on: dict[int, str] = {}

    @property
    def waiting(self) -> dict[int, str]:
        """Platforms of the shards that wait for a worker; "" is any platform."""
        return {
            self._islands[number]: platform
            for number, platform in self._fleet.shards.waiting.items()
            if number in self._islands
        }

    def holder(self, shard: int) -> str:
        """Return the name of the worker that holds a shard; empty if none does."""
        number = self._numbers.get(shard)
        return "" if number is None else self._fleet.shards.holder(number)

    def step(self, shard: int) -> int:
        """Return the step that a shard has reached."""
        return self._past(shard).step

    def requested(self, shard: int) -> AdvanceShard | None:
        """Return the advance of a shard that is requested, or noted."""
        return self._past(shard).requested

    def begin_at(self, advances: Sequence[tuple[AdvanceShard, Advanced]]) -> None:
        """Let a shard begin with a snapshot, which the store has.

        Args:
            advances: commands and results from the arena's first advance to that of
                the snapshot.
        """
        windows: dict[BirthId, int] = {}
        begin = 0
        for command, result in advances:
            windows |= dict.fromkeys(restarted(command.changes), begin)
            begin = result.advance.step
        _, event = advances[-1]
        past, advance = self._past(event.island), event.advance
        past.step = past.base = advance.step
        past.digest, past.platform = advance.digest, event.provenance.platform
        past.places = {one.birth: one.place for one in advance.judgements}
        timestep_s = self._context.experiments[event.island].simulation.timestep_s
        past.born = {
            one.birth: Inserted(
                advance.step - round(one.age_s / timestep_s),
                None,
                windows.get(one.birth, 0),
            )
            for one in advance.judgements
        }

    def past(self, shard: int) -> Rebuild:
        """Return what a worker needs to rebuild a shard's state."""
        past = self._past(shard)
        base = self._snapshot_store.read(shard, past.base) if past.base else b""
        return Rebuild(base, tuple(past.history))

    def note(self, command: AdvanceShard) -> None:
        """Remember the advance that an arena requests, but do not send it yet."""
        self._past(command.island).requested = command

    def send_noted(self) -> None:
        """Request all advances that were noted."""
        for _, past in sorted(self._pasts.items()):
            if past.requested is not None:
                self.send(past.requested)

    def send(self, command: AdvanceShard, repeats: Advanced | None = None) -> None:
        """Request an advance.

        Args:
            command: the advance.
            repeats: past result of this advance, to be computed again on the same
                platform; another result is the worker's error.
        """
        shard = command.island
        past = self._past(shard)
        past.requested, past.repeats = command, repeats
        platform = past.platform
        if repeats is not None:
            platform = repeats.provenance.platform
            if self._repeated_on.setdefault(shard, platform) != platform:
                self._repeated_on[shard] = platform
                self._fleet.release(self._numbers.pop(shard))
        if shard not in self._numbers:
            number = self._fleet.new_shard(
                self._context.client, self._encode, platform, may_drift=repeats is None
            )
            self._numbers[shard], self._islands[number] = number, shard
        timestep_s = self._context.experiments[shard].simulation.timestep_s
        simulated_s = (command.until - past.step) * timestep_s
        self._fleet.advance(self._numbers[shard], simulated_s)

    def request_snapshot(self, shard: int) -> None:
        """Request a snapshot at the end of the next advance that is assigned."""
        self._past(shard).wants_snapshot = True

    def commit(self, event: Advanced) -> Drift | None:
        """Remember the result of an advance, now that the journal has it.

        Returns:
            The drift, if it was made on another platform than the one before.

        Raises:
            UnexpectedEvent: no such advance was requested.
        """
        past, advance = self._past(event.island), event.advance
        requested = past.requested
        if requested is None or requested.number != event.number:
            raise UnexpectedEvent(f"no such advance was requested: {event}")
        past.requested = None
        born = past.born_after(requested.changes, self._space(event.island))
        living = {one.birth for one in advance.judgements}
        past.born = {birth: at for birth, at in born.items() if birth in living}
        past.step, past.digest = advance.step, advance.digest
        agent, platform = event.provenance.agent, event.provenance.platform
        drift: Drift | None = None
        if past.drifts_to(platform):
            before = past.platform
            drift = Drift(event.island, advance.step, before, platform, agent)
        past.platform = platform
        past.history.append(
            PastAdvance(requested.changes, requested.until, advance.digest)
        )
        past.places = {one.birth: one.place for one in advance.judgements}
        store, may_be_kept = self._snapshot_store, past.may_be_kept
        if may_be_kept and store.has(event.island, past.step, past.digest):
            past.base, past.history = past.step, []
            store.drop_before(event.island, past.step)
        past.may_be_kept = True
        return drift

    def refusal(self, end: ShardFailed) -> JobRefused | RunFolderError:
        """Return the error that stops a run whose arena cannot be advanced."""
        if not end.agent:
            return RunFolderError(end.reason)
        return JobRefused(
            f"arena {self._islands[end.shard]}: several workers cannot advance it, the "
            f"last of them {end.agent}: {end.reason}; fix that and resume"
        )

    def _space(self, shard: int) -> BodySpace:
        return body_space(self._context.experiments[shard].space)

    def _past(self, shard: int) -> _Past:
        return self._pasts.setdefault(shard, _Past())

    def _encode(self, command: AssignShard) -> tuple[bytes, Read]:
        """Return the request for a worker, and what reads the answer."""
        shard = self._islands[command.shard]
        past, settings = self._past(shard), self._context.arena[shard]
        requested = past.requested
        assert requested is not None
        is_drift = past.drifts_to(command.platform)
        # Nothing from before a drift is ever repeated.
        wants_snapshot = requested.wants_snapshot or past.wants_snapshot or is_drift
        past.wants_snapshot, past.may_be_kept = False, wants_snapshot
        past.requested = structs.replace(requested, wants_snapshot=wants_snapshot)
        rebuild: Rebuild | None = None
        if command.is_whole:
            rebuild = self.past(shard)
            if is_drift:
                rebuild = replace(rebuild, living=tuple(past.places))
        request = AdvanceRequest(
            run=self._context.client.run,
            epoch=self._context.client.epoch,
            number=command.number,
            settings=settings,
            shard=shard,
            from_step=past.step,
            from_digest=past.digest,
            changes=requested.changes,
            until=requested.until,
            wants_snapshot=wants_snapshot,
            rebuild=rebuild,
        )
        complete: Callable[[Advance], Advance] | None = None
        if is_drift:
            complete = partial(
                with_losses,
                step=past.step,
                places=past.places,
                removals=requested.changes.removals,
            )
        read = partial(
            _read_answer,
            shard=shard,
            advance_number=requested.number,
            repeats=past.repeats,
            expected=ExpectedAdvance(
                (request.epoch, request.number),
                past.step,
                requested.until,
                past.born_after(requested.changes, self._space(shard)),
                self._context.experiments[shard],
                wants_snapshot,
                command.is_whole,
            ),
            provenance=Provenance(command.agent, command.platform),
            complete=complete,
        )
        return encode_advance_request(request, plugins_of(settings)), read


def _read_answer(
    data: bytes,
    *,
    shard: int,
    advance_number: int,
    repeats: Advanced | None,
    expected: ExpectedAdvance,
    provenance: Provenance,
    complete: Callable[[Advance], Advance] | None,
) -> Reached | None:
    """Return the decoded answer to a request; None if the worker lacks the state.

    Args:
        data: bytes of the answer.
        shard: number of the island.
        advance_number: number of the arena's command.
        repeats: past result that the answer must have; None for a new advance.
        expected: what a correct answer has.
        provenance: of the answer, but for the time that it took.
        complete: adds what a drift between platforms lost; None without a drift.

    Raises:
        MalformedMessage: no answer, the answer to another request, or one that
            contradicts the request or the state of the arena.
    """
    answer = decode_advance_answer(data, expected.most_bytes)
    check_answer(answer, expected)
    advance = answer.advance
    if advance is None:
        return None
    if complete is not None:
        advance = complete(advance)
    check_advance(advance, expected)
    rows = read_poses(advance.poses, advance, expected)
    if repeats is not None:
        _check_repeated(advance, rows.num_rows, repeats)
    poses = place_poses(advance.poses, rows, shard)
    signed = replace(provenance, wall_s=answer.wall_s)
    event = Advanced(
        shard,
        advance_number,
        replace(advance, poses=poses),
        rows.num_rows,
        signed,
    )
    return Reached(event, answer.snapshot)


def _check_repeated(advance: Advance, rows: int, repeats: Advanced) -> None:
    """Raise unless an advance has a past result.

    Raises:
        MalformedMessage: another digest or number of poses.
    """
    got, must = (advance.digest, rows), (repeats.advance.digest, repeats.pose_rows)
    if got != must:
        raise MalformedMessage(
            f"advance to step {advance.step}: the digest of its state and its "
            f"number of poses must be {must[0].hex()[:16]}... and {must[1]}, got "
            f"{got[0].hex()[:16]}... and {got[1]}: this machine's results differ",
            "differs",
        )
