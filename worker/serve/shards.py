"""Arena shards of a worker: advancing and rebuilding them.

A shard is long-lived state. A worker that holds the state that a request starts from
continues from there. Otherwise it asks for a history, rebuilds the state, and compares
the digest of each advance with the recorded one.

A request may come twice: a coordinator sends it again if it waited in a queue for too
long. The second one is answered from memory, and the state stays.
"""

import time
from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol, Self

from schema.errors import StateDiffers
from schema.experiment.brains import types_of
from schema.experiment.settings import ArenaSettings, read_arena_settings
from schema.robot.ids import BirthId
from schema.robot.robot import check_robot
from schema.wire.arena import Advance, Changes
from schema.wire.arena_codec import (
    AdvanceAnswer,
    AdvanceRequest,
    Live,
    PastAdvance,
    Rebuild,
    decode_advance_request,
    encode_advance_answer,
    encode_live,
)
from schema.wire.decoding import fingerprint
from worker.arena.changes import possible
from worker.serve.checks import checked_arena

Key = tuple[str, int]
"""Name of a shard: its run and its number."""


class World(Protocol):
    """Interface of ``worker.arena.world.World``."""

    def __init__(self, settings: ArenaSettings, threads: int = 1) -> None:
        """Initialise an empty arena."""

    @classmethod
    def restore(cls, settings: ArenaSettings, data: bytes, threads: int = 1) -> Self:
        """Return the arena of a snapshot."""

    @property
    def step(self) -> int:
        """Physics steps since the start."""

    @property
    def births(self) -> tuple[BirthId, ...]:
        """Births of the living robots."""

    def apply(self, changes: Changes) -> None:
        """Remove robots, insert robots, replace brains."""

    def advance(self, until: int) -> Advance:
        """Advance to a step and report."""

    def snapshot(self) -> bytes:
        """Return the whole state."""

    def digest(self) -> bytes:
        """Return the SHA-256 of the whole state."""

    def close(self) -> None:
        """Stop its threads."""


class Outlet(Protocol):
    """Interface of ``schema.agent.service.Outlet``."""

    def has_listeners(self, key: str) -> bool:
        """Return whether any viewer subscribes to a key."""

    def put(self, key: str, data: bytes) -> None:
        """Publish bytes."""


@dataclass(slots=True)
class _Held:
    """A shard after its latest advance.

    Attributes:
        world: the arena.
        settings: as in the request.
        digest: of its state; empty before the first advance.
        request: fingerprint of the request for the latest advance.
        answer: to that request.
    """

    world: World
    settings: bytes
    digest: bytes
    request: bytes = b""
    answer: bytes = b""


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

        Args:
            world: class of the arenas.
            most_held: shards to keep; the least recently used is dropped first.
            threads: that step clusters of an arena; results do not depend on it.
            outlet: publishes each advance for live viewers.
            key_of: returns the key of a shard's advances.
        """
        self._world = world
        self._most_held = most_held
        self._threads = threads
        self._outlet, self._key_of = outlet, key_of
        self._held: OrderedDict[Key, _Held] = OrderedDict()

    def answer(self, request: bytes) -> bytes:
        """Return the encoded answer to an encoded request to advance a shard.

        A function of the request but for ``wall_s``, if the state that it starts from
        is kept or comes with it, or if it is the request for the latest advance.
        Otherwise the answer asks for the state.

        Raises:
            MalformedMessage: the bytes are no such request.
            ExperimentError: invalid settings, or a plug-in that is unknown or breaks
                its contract.
            InvalidRobot: an insertion that breaks the rules of its body space.
            StateDiffers: the rebuilt state differs from the original one.
        """
        start = time.perf_counter()
        job = decode_advance_request(request, checked_arena)
        key, asked = (job.run, job.shard), fingerprint(request)
        if answer := self._answered(key, asked):
            return answer
        settings = checked_arena(job.settings)
        _check_robots(job.changes, settings)
        # Not kept while it changes, so that an error below leaves no broken shard.
        held, changes = self._taken(job), job.changes
        if held is None and job.rebuild is not None:
            held = _Held(self._rebuilt(job, job.rebuild), job.settings, job.from_digest)
            if job.rebuild.living is not None:
                changes = possible(changes, held.world.births)
        if held is None:
            wall_s = time.perf_counter() - start
            return encode_advance_answer(
                AdvanceAnswer(job.epoch, job.number, wall_s, None)
            )
        with _closed_on_error(held.world) as world:
            world.apply(changes)
            advance = world.advance(job.until)
            snapshot = world.snapshot() if job.wants_snapshot else b""
            wall_s = time.perf_counter() - start
            answer = encode_advance_answer(
                AdvanceAnswer(job.epoch, job.number, wall_s, advance, snapshot)
            )
        held.digest, held.request, held.answer = advance.digest, asked, answer
        self._keep(key, held)
        self._publish(Live(job.run, job.shard, advance))
        return answer

    def _answered(self, key: Key, asked: bytes) -> bytes:
        """Return the answer to the latest request of a shard; b"" for another one."""
        held = self._held.get(key)
        if held is None or held.request != asked:
            return b""
        self._held.move_to_end(key)
        return held.answer

    def _publish(self, live: Live) -> None:
        """Publish an advance; it is encoded only for viewers."""
        if self._outlet is None:
            return
        key = self._key_of(live.shard)
        if self._outlet.has_listeners(key):
            self._outlet.put(key, encode_live(live))

    def _taken(self, job: AdvanceRequest) -> _Held | None:
        """Remove and return the state that a request starts from, if it is kept."""
        held = self._held.pop((job.run, job.shard), None)
        if held is None:
            return None
        found = (held.world.step, held.digest, held.settings)
        if found != (job.from_step, job.from_digest, job.settings):
            held.world.close()
            return None
        return held

    def _keep(self, key: Key, held: _Held) -> None:
        self._held[key] = held
        if len(self._held) > self._most_held:
            self._held.popitem(last=False)[1].world.close()

    def _rebuilt(self, job: AdvanceRequest, rebuild: Rebuild) -> World:
        """Return the arena in the state that a request starts from.

        Raises:
            StateDiffers: a state on the way differs from the original one.
        """
        settings = read_arena_settings(job.settings)
        if rebuild.snapshot:
            world = self._world.restore(settings, rebuild.snapshot, self._threads)
        else:
            world = self._world(settings, self._threads)
        with _closed_on_error(world):
            if rebuild.living is None:
                _repeat(world, rebuild.history)
            else:
                _approximate(world, rebuild.history, rebuild.living)
            if world.step != job.from_step:
                raise StateDiffers(
                    f"shard {job.shard}: rebuilt to step {world.step}, must be "
                    f"{job.from_step}"
                )
            is_only_snapshot = not rebuild.history and rebuild.living is None
            if is_only_snapshot and job.from_digest:
                _check_digest(world.step, world.digest(), job.from_digest)
        return world


@contextmanager
def _closed_on_error(world: World) -> Iterator[World]:
    """Close a world if an error occurs."""
    try:
        yield world
    except BaseException:
        world.close()
        raise


def _check_robots(changes: Changes, settings: ArenaSettings) -> None:
    space, kinds = _types_of(settings)
    for insertion in changes.insertions:
        check_robot(insertion.robot, space, kinds)


_types_of = lru_cache(maxsize=64)(types_of)


def _repeat(world: World, history: Sequence[PastAdvance]) -> None:
    """Repeat a history of the same platform, equal to the last bit.

    Raises:
        StateDiffers: at the first advance with another digest.
    """
    for past in history:
        world.apply(past.changes)
        digest = world.advance(past.until).digest
        _check_digest(world.step, digest, past.digest)


def _approximate(
    world: World, history: Sequence[PastAdvance], living: Sequence[BirthId]
) -> None:
    """Repeat a history of another platform as exactly as this platform can.

    Robots that are not among ``living`` are removed at the end. Robots that diverge
    only on this platform are not restored.
    """
    for past in history:
        world.apply(possible(past.changes, world.births))
        world.advance(past.until)
    world.apply(Changes(tuple(sorted(set(world.births) - set(living)))))


def _check_digest(step: int, digest: bytes, expected: bytes) -> None:
    if digest != expected:
        raise StateDiffers(
            f"at step {step} the arena's digest must be {expected.hex()[:16]}..., "
            f"got {digest.hex()[:16]}...: this machine's results differ"
        )
