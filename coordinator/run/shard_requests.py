"""Requests to advance the arena shards of a run, and their results.

The changes and advances since a shard's newest snapshot are kept, so that another
worker can rebuild its state. Nothing here decides what happens in an arena.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from functools import partial

from msgspec import structs

from coordinator.arena.drift import Drift, with_losses
from coordinator.dispatch.events import Assign, Deliver, Read
from coordinator.dispatch.fleet import JobRouter
from coordinator.dispatch.shard_places import ShardPlaces
from coordinator.islands.events import Advanced
from coordinator.parts.arena_parts import EXCHANGE_S
from coordinator.run.advance_checks import (
    ExpectedAdvance,
)
from coordinator.run.part_requests import PartRequests
from coordinator.run.run_context import RunContext
from coordinator.run.shard_answers import (
    PartReached,
    Reached,
    read_advance,
    with_tracks,
)
from coordinator.storage.snapshots import Snapshots
from schema.agent.log import tell_user, warn_user
from schema.errors import (
    JobRefused,
    RunFolderError,
    UnexpectedEvent,
)
from schema.experiment.settings import read_arena_settings, split_problems
from schema.limits import ADVANCE_BYTES
from schema.parts import Vector
from schema.robot.ids import BirthId
from schema.robot.results import Provenance
from schema.wire.arena import Advance, AdvanceShard, Changes, PastAdvance, Rebuild
from schema.wire.arena_state import ArenaState
from schema.wire.codec import decode, encode
from schema.wire.poses import PoseArrays
from schema.wire.status import PartStatus

LEAST_PART_S = 0.1
"""An arena has as many parts as its exchanges take multiples of this [s]."""


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
    in_parts: PartRequests | None = None
    wall_s: float = 0.0
    state: bytes = b""
    undivided: str | None = None
    was_divided: bool = False

    def living_after(self, changes: Changes) -> set[BirthId]:
        """Return the robots that live after changes."""
        living = self.places.keys() - set(changes.removals)
        return living | {insertion.birth for insertion in changes.insertions}

    def drifts_to(self, platform: str) -> bool:
        """Return whether a platform differs from that of the last advance."""
        return self.platform not in ("", platform)


class ShardRequests:
    """The advances of all arenas of a run."""

    def __init__(
        self,
        context: RunContext,
        snapshot_store: Snapshots,
        fleet: JobRouter,
        parts: int | None = None,
    ) -> None:
        """Initialise without shards; ``fleet`` has the workers.

        ``parts``: of an arena, as far as there are workers; None: as many as pay.
        """
        self._parts = parts
        self._context = context
        self._snapshot_store = snapshot_store
        self._fleet = fleet
        self._pasts: dict[int, _Past] = {}
        self._places = ShardPlaces(fleet, context.client, self._encode)
        self._repeated_on: dict[int, str] = {}

    @property
    def waiting(self) -> dict[int, str]:
        """Platforms of the shards that wait for a worker; "" is any platform."""
        return self._places.waiting

    def holders(self, shard: int) -> list[str]:
        """Return the names of the workers that hold the parts of a shard."""
        return self._places.holders(shard)

    def divided(self, shard: int) -> tuple[tuple[PartStatus, ...], int]:
        """Return the parts of a shard, if it has several, and their repeats."""
        in_parts = self._past(shard).in_parts
        if in_parts is None:
            return (), 0
        arena = in_parts.parts
        parts = [
            PartStatus(
                self._places.holder((shard, part)),
                len(arena.robots(part)),
                share,
                arena.came[part],
            )
            for part, share in sorted(arena.shares().items())
        ]
        return tuple(parts), arena.repeats

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
                self._places.keep(shard, ())
        count = 1 if repeats else self._count(shard)
        state, past.state = past.state, b""
        if count > 1 and past.in_parts is None and state:
            whole = decode(ArenaState, state, ADVANCE_BYTES)
            past.in_parts = PartRequests(self._context, shard, whole, past.wall_s)
            if not past.was_divided:
                past.was_divided = True
                tell_user(f"arena {shard}: {count} workers advance it together")
        if past.in_parts is not None:
            past.in_parts.begin(command, past.places, count)
            parts = past.in_parts.parts.missing
            self._places.keep(shard, {0, *parts})
            self._send_parts(shard, parts)
            return
        self._places.keep(shard, (0,))
        # An arena is divided from a state that is known here.
        past.wants_snapshot |= count > 1
        timestep_s = self._context.experiments[shard].simulation.timestep_s
        simulated_s = (command.until - past.step) * timestep_s
        place, may_drift = (shard, 0), repeats is None
        number = self._places.number(place, platform, may_drift=may_drift)
        self._fleet.advance(number, simulated_s)

    def _count(self, shard: int) -> int:
        """Return how many parts a shard is to have, as far as there are workers."""
        past = self._past(shard)
        able = self._places.able(shard) // len(self._pasts)
        wanted = self._parts or int(past.wall_s / LEAST_PART_S)
        count = max(1, min(able, wanted))
        return count if count == 1 or self._is_divisible(shard) else 1

    def _is_divisible(self, shard: int) -> bool:
        """Return whether an arena may have parts; say once why not."""
        past = self._past(shard)
        if past.undivided is None:
            settings = read_arena_settings(self._context.arena[shard])
            past.undivided = next(split_problems(settings), "")
            if past.undivided:
                warn_user(
                    f"arena {shard}: one worker advances it, whatever others there "
                    f"are: {past.undivided}"
                )
        return not past.undivided

    def _send_parts(self, shard: int, parts: Iterable[int]) -> None:
        past = self._past(shard)
        assert past.in_parts is not None
        for part in parts:
            number = self._places.number((shard, part), past.platform)
            self._fleet.advance(number, past.in_parts.simulated_s())

    def take(self, end: Deliver) -> Reached | None:
        """Take the end of an advance, or of a part of one.

        Returns:
            The advance; None if parts of it are still missing.

        Raises:
            JobRefused: several workers cannot advance it.
            RunFolderError: its snapshot cannot be read.
        """
        shard, part = self._places.place(end.job.shard)
        past = self._past(shard)
        if part and past.in_parts is None:
            # Since a drift the worker of part 0 advances the whole arena.
            return None
        if isinstance(end.answer, Reached):
            reached = end.answer
            past.wall_s = self._exchange_s(reached.event)
        elif past.in_parts is None or not isinstance(end.answer, PartReached):
            raise self._refusal(end)
        else:
            count = self._count(shard)
            advance = past.in_parts.take(part, end.answer, count)
            past.wall_s = past.in_parts.wall_s
            if not isinstance(advance, Advance):
                self._send_parts(shard, advance)
                return None
            reached = self._joined(past, advance)
            if past.in_parts.parts.used == {0} and count == 1:
                past.in_parts = None
        past.state = reached.snapshot
        return reached

    def _exchange_s(self, event: Advanced) -> float:
        """Return the time that workers take for an exchange of the whole arena [s]."""
        clock = self._context.experiments[event.island].simulation
        steps = event.advance.step - self._past(event.island).step
        simulated_s = steps * clock.timestep_s
        return event.provenance.wall_s * EXCHANGE_S / simulated_s

    def _joined(self, past: _Past, advance: Advance) -> Reached:
        """Return an advance that all parts have made."""
        requested, in_parts = past.requested, past.in_parts
        assert requested is not None
        assert in_parts is not None
        wants_snapshot = requested.wants_snapshot or past.wants_snapshot
        past.wants_snapshot, past.may_be_kept = False, wants_snapshot
        poses = PoseArrays.received(advance.poses)
        if requested.wants_tracks:
            advance = with_tracks(advance, poses)
        event = Advanced(
            requested.island,
            requested.number,
            advance,
            len(poses.births),
            in_parts.provenance,
        )
        return Reached(event, encode(in_parts.parts.state) if wants_snapshot else b"")

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

    def _refusal(self, end: Deliver) -> JobRefused | RunFolderError:
        """Return the error that stops a run whose arena cannot be advanced."""
        if not end.agent:
            return RunFolderError(end.reason)
        arena, _ = self._places.place(end.job.shard)
        return JobRefused(
            f"arena {arena}: several workers cannot advance it, the "
            f"last of them {end.agent}: {end.reason}; fix that and resume"
        )

    def _past(self, shard: int) -> _Past:
        return self._pasts.setdefault(shard, _Past())

    def _encode(self, command: Assign) -> tuple[bytes, Read]:
        """Return the request for a worker, and what reads the answer."""
        shard, part = self._places.place(command.job.shard)
        past = self._past(shard)
        requested = past.requested
        assert requested is not None
        is_drift = past.drifts_to(command.platform)
        if past.in_parts is not None and is_drift:
            past.in_parts = None
            self._places.make_whole((shard, part))
        if past.in_parts is not None:
            return past.in_parts.encode(part, command)
        # Nothing from before a drift is ever repeated.
        wants_snapshot = requested.wants_snapshot or past.wants_snapshot or is_drift
        past.wants_snapshot, past.may_be_kept = False, wants_snapshot
        past.requested = structs.replace(requested, wants_snapshot=wants_snapshot)
        rebuild: Rebuild | None = None
        if command.is_whole:
            rebuild = self.past(shard)
            if is_drift:
                rebuild = structs.replace(rebuild, living=tuple(past.places))
        work = structs.replace(
            past.requested,
            from_step=past.step,
            from_digest=past.digest,
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
            read_advance,
            requested=requested,
            job=(self._context.client.epoch, command.job.number),
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
        return self._context.arena_request(command.job.number, work), read
