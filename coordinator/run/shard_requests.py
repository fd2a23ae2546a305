"""Requests to advance the arena shards of a run, and their results.

The changes and advances since a shard's newest snapshot are kept, so that another
worker can rebuild its state. Nothing here decides what happens in an arena.
"""

from collections.abc import Callable
from dataclasses import dataclass, field
from functools import partial

from msgspec import structs

from coordinator.dispatch.events import Assign, Deliver, Read
from coordinator.dispatch.fleet import JobRouter
from coordinator.islands.events import Advanced
from coordinator.run.advance_checks import ExpectedAdvance, check_advance, check_poses
from coordinator.run.drift import Drift, with_losses
from coordinator.run.requests import Expected, impossible, read_answer
from coordinator.run.run_context import RunContext
from coordinator.storage.snapshots import Snapshots
from schema.errors import (
    NO_MESSAGE,
    JobRefused,
    MalformedMessage,
    RunFolderError,
    UnexpectedEvent,
)
from schema.limits import ADVANCE_BYTES, LONGEST_REASON, printable
from schema.parts import Vector
from schema.plugins.source import plugins_of
from schema.robot.ids import BirthId
from schema.robot.results import Provenance
from schema.wire.arena import Advance, AdvanceShard, Changes, PastAdvance, Rebuild
from schema.wire.codec import encode
from schema.wire.messages import Request, StateMissing
from schema.wire.poses import PoseArrays


@dataclass(slots=True)
class _Past:
    """What has happened to a shard.

    Its state at ``step`` is that of the newest snapshot, at ``base`` (0 is the empty
    arena), after ``history``; the snapshot at ``kept`` stays, too. ``platform`` is that
    of the last advance, empty before the first; ``places`` are those of the robots that
    lived after it. The requested advance may have a snapshot in the store if
    ``may_be_kept``, as in any replay. It must have the result of ``repeats``, if there
    is one.
    """

    step: int = 0
    platform: str = ""
    digest: bytes = b""
    base: int = 0
    kept: int = 0
    history: list[PastAdvance] = field(default_factory=list)
    places: dict[BirthId, Vector] = field(default_factory=dict)
    requested: AdvanceShard | None = None
    repeats: Advanced | None = None
    wants_snapshot: bool = False
    may_be_kept: bool = True

    def living_after(self, changes: Changes) -> set[BirthId]:
        """Return the robots that live after changes."""
        living = self.places.keys() - set(changes.removals)
        return living | {insertion.birth for insertion in changes.insertions}

    def drifts_to(self, platform: str) -> bool:
        """Return whether a platform differs from that of the last advance."""
        return self.platform not in ("", platform)


@dataclass(frozen=True, slots=True)
class Reached:
    """A decoded answer to a request to advance a shard.

    Attributes:
        snapshot: the state that was reached; empty if it was not wanted.
    """

    event: Advanced
    snapshot: bytes


class ShardRequests:
    """The advances of all arenas of a run."""

    def __init__(
        self, context: RunContext, snapshot_store: Snapshots, fleet: JobRouter
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
            for number, platform in self._fleet.homes.waiting.items()
            if number in self._islands
        }

    def holder(self, shard: int) -> str:
        """Return the name of the worker that holds a shard; empty if none does."""
        number = self._numbers.get(shard)
        return "" if number is None else self._fleet.homes.holder(number)

    def step(self, shard: int) -> int:
        """Return the step that a shard has reached."""
        return self._past(shard).step

    def requested(self, shard: int) -> AdvanceShard | None:
        """Return the advance of a shard that is requested, or noted."""
        return self._past(shard).requested

    def begin_at(self, event: Advanced) -> None:
        """Let a shard begin with the snapshot of an advance, which the store has."""
        past, advance = self._past(event.island), event.advance
        past.step = past.base = advance.step
        past.digest, past.platform = advance.digest, event.provenance.platform
        past.places = {one.birth: one.place for one in advance.judgements}

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

        ``repeats``: past result of this advance, to be computed again on the same
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

    def keep_snapshots(self) -> None:
        """Keep the newest snapshot of each shard, unless an earlier one is kept.

        A longer run begins there if what comes now is not part of it.
        """
        for past in self._pasts.values():
            past.kept = past.kept or past.base

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
            store.drop_before(event.island, past.step, past.kept)
        past.may_be_kept = True
        return drift

    def refusal(self, end: Deliver) -> JobRefused | RunFolderError:
        """Return the error that stops a run whose arena cannot be advanced."""
        if not end.agent:
            return RunFolderError(end.reason)
        arena = self._islands[end.job.shard]
        return JobRefused(
            f"arena {arena}: several workers cannot advance it, the "
            f"last of them {end.agent}: {end.reason}; fix that and resume"
        )

    def _past(self, shard: int) -> _Past:
        return self._pasts.setdefault(shard, _Past())

    def _encode(self, command: Assign) -> tuple[bytes, Read]:
        """Return the request for a worker, and what reads the answer."""
        shard = self._islands[command.job.shard]
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
                rebuild = structs.replace(rebuild, living=tuple(past.places))
        run, epoch = self._context.client
        work = structs.replace(
            past.requested,
            from_step=past.step,
            from_digest=past.digest,
            rebuild=rebuild,
        )
        request = Request(
            run, epoch, command.job.number, work, settings, plugins_of(settings)
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
            requested=requested,
            job=(epoch, command.job.number),
            is_whole=command.is_whole,
            repeats=past.repeats,
            expected=ExpectedAdvance(
                past.step,
                requested.until,
                past.living_after(requested.changes),
                self._context.experiments[shard],
                wants_snapshot,
                requested.wants_tracks,
            ),
            provenance=Provenance(command.agent, command.platform),
            complete=complete,
        )
        return encode(request), read


def _read_answer(
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
    answer = read_answer(data, job, Advance | StateMissing, ADVANCE_BYTES)
    advance = answer.result
    if isinstance(advance, StateMissing) and not is_whole:
        return None
    if not isinstance(advance, Advance):
        raise impossible("answer: lacks the state that came with the request")
    if complete is not None:
        advance = complete(advance)
    check_advance(advance, expected)
    rows = check_poses(advance, expected)
    if requested.wants_tracks:
        robots = [judgement.birth for judgement in advance.judgements]
        tracks = PoseArrays.received(advance.poses).tracks(robots)
        advance = structs.replace(advance, tracks=tracks.tobytes())
    if repeats is not None:
        _check_repeated(advance, rows, repeats)
    casualties = tuple(
        structs.replace(one, reason=printable(one.reason, LONGEST_REASON) or NO_MESSAGE)
        for one in advance.casualties
    )
    snapshot = advance.snapshot
    advance = structs.replace(advance, casualties=casualties, snapshot=b"")
    signed = structs.replace(provenance, wall_s=answer.wall_s)
    event = Advanced(requested.island, requested.number, advance, rows, signed)
    return Reached(event, snapshot)


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
