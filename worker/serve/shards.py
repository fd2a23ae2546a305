"""The arena shards that a worker holds, and what it is asked to do with them.

A shard is long-lived state. A worker that holds the state that a request starts
from goes on from there; one that does not is told how to rebuild it, and compares
every step of that with what it was when it happened first.
"""

import time
from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Protocol, Self

from schema.errors import StateDiffers
from schema.experiment.document import body_space
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
)
from worker.arena.births import possible

MOST_HELD = 16
"""Shards that one process keeps; the one that rested longest goes first."""

Key = tuple[str, int]
"""What a shard is known by: its run and its number."""


class World(Protocol):
    """A living arena, as ``worker.arena.world`` has it."""

    def __init__(self, settings: ArenaSettings, threads: int = 1) -> None:
        """Make an empty arena."""

    @classmethod
    def restore(cls, settings: ArenaSettings, data: bytes, threads: int = 1) -> Self:
        """Return the arena of a snapshot."""

    @property
    def step(self) -> int:
        """Physics steps since it began."""

    @property
    def births(self) -> tuple[BirthId, ...]:
        """The names of the living."""

    def apply(self, changes: Changes) -> None:
        """Remove, insert, replace."""

    def advance(self, until: int) -> Advance:
        """Go on to a step; say what it came to."""

    def snapshot(self) -> bytes:
        """Return the whole state."""

    def digest(self) -> bytes:
        """Return the SHA-256 of the whole state."""

    def close(self) -> None:
        """Let its threads end."""


@dataclass(slots=True)
class _Held:
    """A shard as it was left; ``digest`` is empty before its first advance."""

    world: World
    settings: bytes
    digest: bytes


class Shards:
    """All shards of one process."""

    def __init__(
        self,
        world: type[World],
        *,
        threads: int = 1,
        publish: Callable[[Live], None] = lambda _: None,
    ) -> None:
        """Hold nothing yet.

        Args:
            world: what makes and restores arenas.
            threads: that advance one arena together; the result is the same.
            publish: told of each advance, for those who watch.
        """
        self._world = world
        self._threads = threads
        self._publish = publish
        self._held: OrderedDict[Key, _Held] = OrderedDict()

    @property
    def held(self) -> list[Key]:
        """Whose state is here, the one that rested longest first."""
        return list(self._held)

    def answer(self, request: bytes) -> bytes:
        """Return the encoded answer to an encoded request to advance a shard.

        A function of its content but for ``wall_s``, if the state that it starts
        from is here or comes with it; otherwise the answer asks for that.

        Raises:
            MalformedMessage: bytes that are no such request.
            ExperimentError: settings that are none, or a plug-in that is not here.
            InvalidRobot: an insertion that breaks the rules of its body space.
            StateDiffers: what was rebuilt is not what it was.
        """
        began = time.perf_counter()
        job = decode_advance_request(request)
        settings = read_arena_settings(job.settings)
        _check_robots(job.changes, settings)
        # Out of our hands until it is whole again: whatever fails below leaves none.
        held, changes = self._taken(job), job.changes
        if held is None and job.rebuild is not None:
            held = _Held(self._rebuilt(job, job.rebuild), job.settings, job.from_digest)
            if job.rebuild.living is not None:
                changes = possible(changes, held.world.births)
        advance: Advance | None = None
        snapshot = b""
        if held is not None:
            with _closed_on_error(held.world) as world:
                world.apply(changes)
                advance = world.advance(job.until)
                snapshot = world.snapshot() if job.wants_snapshot else b""
            held.digest = advance.digest
            self._keep((job.run, job.shard), held)
            self._publish(Live(job.run, job.shard, advance))
        wall_s = time.perf_counter() - began
        return encode_advance_answer(
            AdvanceAnswer(job.epoch, job.number, wall_s, advance, snapshot)
        )

    def _taken(self, job: AdvanceRequest) -> _Held | None:
        """Return the state that a request starts from, if it is here."""
        held = self._held.pop((job.run, job.shard), None)
        is_it = (
            held is not None
            and held.world.step == job.from_step
            and held.digest == job.from_digest
            and held.settings == job.settings
        )
        if held is not None and not is_it:
            held.world.close()
        return held if is_it else None

    def _keep(self, key: Key, held: _Held) -> None:
        self._held[key] = held
        if len(self._held) > MOST_HELD:
            self._held.popitem(last=False)[1].world.close()

    def _rebuilt(self, job: AdvanceRequest, rebuild: Rebuild) -> World:
        """Return the arena in the state to start from.

        Raises:
            StateDiffers: somewhere on the way it is not what it was.
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
                _imitate(world, rebuild.history, rebuild.living)
            if world.step != job.from_step:
                raise StateDiffers(
                    f"shard {job.shard}: rebuilt to step {world.step}, must be "
                    f"{job.from_step}"
                )
            is_as_it_came = not rebuild.history and rebuild.living is None
            if is_as_it_came and job.from_digest:
                _check_digest(world.step, world.digest(), job.from_digest)
        return world


@contextmanager
def _closed_on_error(world: World) -> Iterator[World]:
    """Give up a world that an error left half-way."""
    try:
        yield world
    except BaseException:
        world.close()
        raise


def _check_robots(changes: Changes, settings: ArenaSettings) -> None:
    space = body_space(settings.space)
    for insertion in changes.insertions:
        check_robot(insertion.robot, space)


def _repeat(world: World, history: Sequence[PastAdvance]) -> None:
    """Do all again, to the last bit.

    Raises:
        StateDiffers: at the first advance that comes to something else.
    """
    for past in history:
        world.apply(past.changes)
        digest = world.advance(past.until).digest
        _check_digest(world.step, digest, past.digest)


def _imitate(
    world: World, history: Sequence[PastAdvance], living: Sequence[BirthId]
) -> None:
    """Do again what happened on another platform, as nearly as it goes here.

    Who fell there and not here goes at the end; who fell here only stays away.
    """
    for past in history:
        world.apply(possible(past.changes, world.births))
        world.advance(past.until)
    world.apply(Changes(tuple(sorted(set(world.births) - set(living)))))


def _check_digest(step: int, digest: bytes, expected: bytes) -> None:
    if digest != expected:
        raise StateDiffers(
            f"at step {step} the arena's digest must be {expected.hex()[:16]}..., "
            f"got {digest.hex()[:16]}...: this machine computes otherwise"
        )
