"""Arena shards of a worker: advancing and rebuilding them.

A shard is long-lived state. A worker that holds the state that a request starts from
continues from there. Otherwise it asks for a history, rebuilds the state, and compares
the digest of each advance with the recorded one.
"""

from collections import OrderedDict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache

from msgspec.structs import replace

from schema.agent.service import Outlet
from schema.errors import MalformedMessage, StateDiffers
from schema.experiment.brains import types_of
from schema.experiment.settings import read_arena_settings
from schema.limits import ADVANCE_BYTES
from schema.robot.ids import BirthId
from schema.robot.robot import check_robot
from schema.wire.arena import (
    Advance,
    AdvanceShard,
    ArenaPart,
    Changes,
    Live,
    Rebuild,
)
from schema.wire.arena_state import ArenaState
from schema.wire.codec import decode, encode
from schema.wire.messages import Request, StateMissing
from worker.arena.changes import possible
from worker.arena.world import World
from worker.kinds import checked

Key = tuple[str, int, int]
"""Name of a shard: its run, its number, and the number of a part of it."""


@dataclass(slots=True)
class _Held:
    """A shard after its latest advance; the digest is empty before the first one."""

    world: World
    settings: bytes
    digest: bytes


class Shards:
    """Arena shards of one process."""

    def __init__(
        self,
        world: type[World],
        *,
        most_held: int = 16,
        threads: int = 1,
        outlet: Outlet | None = None,
        key_of: Callable[[int], str] = str,
    ) -> None:
        """Initialise without shards.

        ``most_held``: shards to keep; the least recently used is dropped first.
        ``threads``: that step clusters of an arena; results do not depend on it.
        ``key_of``: returns the key of a shard's advances.
        """
        self._world = world
        self._most_held = most_held
        self._threads = threads
        self._outlet, self._key_of = outlet, key_of
        self._held: OrderedDict[Key, _Held] = OrderedDict()

    def answer(self, request: Request, work: AdvanceShard) -> Advance | StateMissing:
        """Return the result of an advance.

        A function of the request, if the state that it starts from is kept or comes
        with it. Otherwise the answer asks for the state.

        Raises:
            MalformedMessage: an end before the start.
            ExperimentError: invalid settings, or a plug-in that is unknown or breaks
                its contract.
            InvalidRobot: an insertion that breaks the rules of its body space.
            StateDiffers: the rebuilt state differs from the original one.
        """
        if work.until < work.from_step:
            raise MalformedMessage(
                f"until: must be >= from_step = {work.from_step}, got {work.until}"
            )
        settings, part = request.settings, work.part
        key = (request.run, work.island, part.number if part else 0)
        space, kinds = _types_of(checked(read_arena_settings(settings)))
        for insertion in work.changes.insertions:
            check_robot(insertion.robot, space, kinds)
        # Not kept while it changes, so that an error below leaves no broken shard.
        held, changes = self._taken(key, settings, work), work.changes
        if held is None and work.rebuild is not None:
            world = self._rebuilt(settings, work, work.rebuild)
            held = _Held(world, settings, work.from_digest)
            if work.rebuild.living is not None:
                changes = possible(changes, held.world.births)
        if held is None:
            return StateMissing()
        with _closed_on_error(held.world) as world:
            if part is not None:
                world.apply(Changes(part.departures))
                if part.arrivals:
                    world.take_in(decode(ArenaState, part.arrivals, ADVANCE_BYTES))
            world.apply(changes)
            if part is not None and part.checks_merges and not changes.insertions:
                world.check_merges()
            advance = _advance(world, work)
        held.digest = advance.digest
        self._keep(key, held)
        live = replace(advance, snapshot=b"", boxes=(), costs=())
        self._publish(Live(request.run, work.island, live, part is not None))
        return advance

    def _publish(self, live: Live) -> None:
        """Publish an advance; it is encoded only for viewers."""
        if self._outlet is None:
            return
        key = self._key_of(live.shard)
        if self._outlet.has_listeners(key):
            self._outlet.put(key, encode(live))

    def _taken(self, key: Key, settings: bytes, work: AdvanceShard) -> _Held | None:
        """Remove and return the state that an advance starts from, if it is kept."""
        held = self._held.pop(key, None)
        if held is None:
            return None
        kept = (held.world.step, held.digest, held.settings)
        if kept != (work.from_step, work.from_digest, settings):
            held.world.close()
            return None
        return held

    def _keep(self, key: Key, held: _Held) -> None:
        self._held[key] = held
        if len(self._held) > self._most_held:
            self._held.popitem(last=False)[1].world.close()

    def _rebuilt(self, data: bytes, work: AdvanceShard, rebuild: Rebuild) -> World:
        """Return the arena in the state that an advance starts from."""
        settings = read_arena_settings(data)
        if rebuild.snapshot:
            world = self._world.restore(settings, rebuild.snapshot, self._threads)
        else:
            world = self._world(settings, self._threads)
        with _closed_on_error(world):
            _repeat(world, rebuild)
            if world.step != work.from_step:
                raise StateDiffers(
                    f"shard {work.island}: rebuilt to step {world.step}, must be "
                    f"{work.from_step}"
                )
            is_only_snapshot = not rebuild.history and rebuild.living is None
            if is_only_snapshot and work.from_digest:
                _check_digest(world.step, world.digest(), work.from_digest)
        return world


def _advance(world: World, work: AdvanceShard) -> Advance:
    """Advance an arena, or a part of it, after its changes."""
    part, work_j = work.part, None
    if work.wants_tracks:
        work_j = _work_before(world, part)
    costs = {} if part is None else world.costs()
    judges = part is None or part.judges
    advance = world.advance(work.until, work_j=work_j, judges=judges)
    snapshot = encode(world.reached) if work.wants_snapshot else b""
    if part is None:
        return replace(advance, snapshot=snapshot)
    births = sorted({*world.births, *(lost.birth for lost in advance.casualties)})
    return replace(
        advance,
        snapshot=snapshot,
        boxes=tuple(world.swept[birth] for birth in births),
        costs=tuple(costs.get(birth, 0.0) for birth in births),
    )


def _work_before(world: World, part: ArenaPart | None) -> dict[BirthId, float]:
    """Return the work of robots earlier in an advance [J]."""
    if part is None or not part.work_j:
        return {}
    births = world.births
    if len(part.work_j) != len(births):
        raise MalformedMessage(
            f"part: must have {len(births)} works, got {len(part.work_j)}"
        )
    return dict(zip(births, part.work_j, strict=True))


@contextmanager
def _closed_on_error(world: World) -> Iterator[World]:
    """Close a world if an error occurs."""
    try:
        yield world
    except BaseException:
        world.close()
        raise


_types_of = lru_cache(maxsize=64)(types_of)


def _repeat(world: World, rebuild: Rebuild) -> None:
    """Repeat a history, equal to the last bit if it is of the same platform.

    That of another platform is repeated as exactly as this platform can. Robots that
    are not among the living are removed at the end. Robots that diverge only on this
    platform are not restored.
    """
    living = rebuild.living
    for past in rebuild.history:
        is_same = living is None
        world.apply(past.changes if is_same else possible(past.changes, world.births))
        digest = world.advance(past.until).digest
        if is_same:
            _check_digest(world.step, digest, past.digest)
    if living is not None:
        world.apply(Changes(tuple(sorted(set(world.births) - set(living)))))


def _check_digest(step: int, digest: bytes, expected: bytes) -> None:
    if digest != expected:
        raise StateDiffers(
            f"at step {step} the arena's digest must be {expected.hex()[:16]}..., "
            f"got {digest.hex()[:16]}...: this machine's results differ"
        )
