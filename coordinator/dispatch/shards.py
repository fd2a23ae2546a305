"""Which worker holds which arena shard: a pure machine.

A shard's state lives in one worker, and its advances go there. If that worker is
gone, errs or does not have the state after all, the advance goes, with all that is
needed to rebuild the state, to another one of an equal platform: the one with the
fewest shards, ties break on the name. Where none is there the shard waits; for ever,
unless the user allows a drift: then one of another platform gets it after a while.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field

from coordinator.dispatch.events import (
    AssignShard,
    Joined,
    Killed,
    Left,
    Released,
    ShardCommand,
    ShardDone,
    ShardEvent,
    ShardFailed,
    ShardRequested,
    ShardReturned,
    ShardSeen,
    Ticked,
)
from schema.errors import UnexpectedEvent

MAX_ERRORS = 3
REST_S = 0.05
LONGEST_REST_S = 3.2
DRIFT_S = 30.0
"""A shard waits so long for its own platform before it may drift to another."""


@dataclass(slots=True)
class _Shard:
    """A shard; ``holder`` is bound to it and, if ``has_state``, fit to go on.

    ``number`` is that of the job that is out, -1 if none is. Of the present advance:
    ``avoid`` are those who failed at it, ``lost`` the numbers of the jobs of which no
    word came, ``killed`` whom it ended and by what.
    """

    platform: str = ""
    holder: str = ""
    has_state: bool = False
    is_wanted: bool = False
    number: int = -1
    is_whole: bool = False
    errors: int = 0
    failures: int = 0
    avoid: tuple[str, ...] = ()
    lost: tuple[int, ...] = ()
    killed: dict[str, str] = field(default_factory=dict)
    rests_until_s: float | None = None
    drifts_at_s: float | None = None


class ShardDispatch:
    """The machine; ``handle`` is its only door."""

    def __init__(self, numbers: Iterator[int], *, allows_drift: bool = False) -> None:
        """Know nobody.

        Args:
            numbers: of jobs, each used once.
            allows_drift: a shard may go to another platform where its own is gone.
        """
        self._numbers = numbers
        self._allows_drift = allows_drift
        self._shards: dict[int, _Shard] = {}
        self._workers: dict[str, Joined] = {}
        self._out: dict[int, int] = {}
        self._now_s = 0.0

    @property
    def wake_s(self) -> float | None:
        """When the next ``Ticked`` can change something [s]; None: no need."""
        shards = self._shards.values()
        wakes = [*(s.rests_until_s for s in shards), *(s.drifts_at_s for s in shards)]
        # What was due is done; who may drift by now waits for a worker, not for a time.
        return min(
            (wake for wake in wakes if wake is not None and wake > self._now_s),
            default=None,
        )

    @property
    def waiting(self) -> dict[int, str]:
        """Platforms of the shards that wait for a worker; "" is any platform."""
        return {
            number: shard.platform
            for number, shard in sorted(self._shards.items())
            if shard.is_wanted and not self._fit(shard)
        }

    def holder(self, shard: int) -> str:
        """Return which worker holds a shard; empty if none does."""
        known = self._shards.get(shard)
        return known.holder if known else ""

    def shard_that_lost(self, number: int) -> int | None:
        """Return whose present advance a job was of which no word came."""
        for shard, state in self._shards.items():
            if number in state.lost:
                return shard
        return None

    def handle(self, event: ShardEvent) -> list[ShardCommand]:
        """Take an event and return what is to be done, in this order.

        Late news of a job, and whoever joins or leaves twice, change nothing.

        Raises:
            UnexpectedEvent: a shard that is wanted twice.
        """
        match event:
            case Joined():
                if event.kind != "worker":
                    return []
                self._workers[event.agent] = event
            case Left():
                self._leave(event.agent)
            case Ticked():
                self._tick(event.now_s)
            case ShardSeen():
                self._shard(event.shard).platform = event.platform
            case ShardRequested():
                self._want(event.shard)
            case ShardReturned():
                return [*self._came(event), *self._assignments()]
            case Killed():
                return [*self._killed(event), *self._assignments()]
            case Released():
                self._unbind(self._shard(event.shard))
                del self._shards[event.shard]
        return list(self._assignments())

    def _shard(self, number: int) -> _Shard:
        return self._shards.setdefault(number, _Shard())

    def _want(self, number: int) -> None:
        shard = self._shard(number)
        if shard.is_wanted:
            raise UnexpectedEvent(f"shard {number}: is wanted already")
        shard.is_wanted = True

    def _leave(self, agent: str) -> None:
        self._workers.pop(agent, None)
        for shard in self._shards.values():
            if shard.holder == agent:
                self._unbind(shard)

    def _unbind(self, shard: _Shard) -> None:
        if self._out.pop(shard.number, None) is not None:
            shard.lost = (*shard.lost, shard.number)
        shard.holder, shard.has_state, shard.number = "", False, -1

    def _tick(self, now_s: float) -> None:
        self._now_s = now_s
        for shard in self._shards.values():
            if shard.rests_until_s is not None and shard.rests_until_s <= now_s:
                shard.rests_until_s = None
            if self._allows_drift:
                self._wait(shard)

    def _wait(self, shard: _Shard) -> None:
        """Note since when a shard has been without a worker of its platform."""
        is_alone = shard.is_wanted and bool(shard.platform) and not self._equal(shard)
        if not is_alone:
            shard.drifts_at_s = None
        elif shard.drifts_at_s is None:
            shard.drifts_at_s = self._now_s + DRIFT_S

    def _came(self, event: ShardReturned) -> list[ShardCommand]:
        number = self._out.pop(event.number, None)
        if number is None:
            return []
        shard = self._shards[number]
        agent, shard.number = shard.holder, -1
        if event.outcome == "done":
            shard.platform = self._workers[agent].platform
            shard.has_state, shard.is_wanted = True, False
            self._forgive(shard)
            shard.failures = 0
            return [ShardDone(number, agent, event.answer)]
        if event.outcome == "stateless" and not shard.is_whole:
            shard.has_state = False
            return []
        self._unbind(shard)
        if event.outcome == "lost":
            shard.lost = (*shard.lost, event.number)
        shard.avoid = (*shard.avoid, agent)
        shard.rests_until_s = self._now_s + min(
            REST_S * 2**shard.failures, LONGEST_REST_S
        )
        shard.failures += 1
        shard.errors += event.outcome != "lost"
        if shard.errors < MAX_ERRORS:
            return []
        reason = event.reason or "asks for a state that it was given"
        return self._give_up(number, agent, reason)

    def _killed(self, event: Killed) -> list[ShardCommand]:
        number = self.shard_that_lost(event.number)
        if number is None:
            return []
        killed = self._shards[number].killed
        killed[event.agent] = event.cause
        if len(killed) < MAX_ERRORS:
            return []
        causes = ", ".join(sorted(set(killed.values())))
        reason = f"ended its own process {MAX_ERRORS} times, by {causes}"
        self._unbind(self._shards[number])
        return self._give_up(number, event.agent, reason)

    def _give_up(self, number: int, agent: str, reason: str) -> list[ShardCommand]:
        """Try a shard's advance no more."""
        shard = self._shards[number]
        shard.is_wanted = False
        self._forgive(shard)
        return [ShardFailed(number, agent, reason)]

    def _forgive(self, shard: _Shard) -> None:
        """Forget who failed at an advance that is over."""
        shard.errors, shard.avoid, shard.lost, shard.killed = 0, (), (), {}

    def _assignments(self) -> Iterator[ShardCommand]:
        """Hand out what waits and may go to somebody."""
        for number, shard in sorted(self._shards.items()):
            is_ready = shard.is_wanted and shard.number < 0
            if not is_ready or shard.rests_until_s is not None:
                continue
            if not shard.holder:
                shard.holder = self._choice(shard)
            if shard.holder:
                shard.drifts_at_s = None
                shard.number = next(self._numbers)
                shard.is_whole = not shard.has_state
                self._out[shard.number] = number
                platform = self._workers[shard.holder].platform
                yield AssignShard(
                    shard.number, number, shard.holder, platform, shard.is_whole
                )

    def _fit(self, shard: _Shard) -> list[str]:
        """Return the workers that may hold a shard, by name."""
        fit = self._equal(shard)
        if fit or shard.drifts_at_s is None or self._now_s < shard.drifts_at_s:
            return fit
        return sorted(self._workers)

    def _equal(self, shard: _Shard) -> list[str]:
        """Return the workers of a shard's platform, by name."""
        return [
            name
            for name, worker in sorted(self._workers.items())
            if shard.platform in ("", worker.platform)
        ]

    def _choice(self, shard: _Shard) -> str:
        """Return the best worker for a shard, others before those who failed."""
        fit = self._fit(shard)
        fresh = [name for name in fit if name not in shard.avoid]
        holders = [each.holder for each in self._shards.values()]
        return min(
            fresh or fit, key=lambda name: (holders.count(name), name), default=""
        )
