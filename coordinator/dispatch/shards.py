"""State machine that assigns arena shards to workers.

One worker holds the state of a shard and makes its advances. If that worker is gone,
fails or lacks the state, the advance goes, with all that is needed to rebuild the
state, to another worker of an equal platform: the one with the fewest shards; ties
break on the name. A shard without such a worker waits. If the user allows a drift, a
worker of another platform gets it after a while.
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
"""Time that a shard waits for its own platform before it may drift [s]."""


@dataclass(slots=True)
class _Shard:
    """A shard and its present advance.

    Attributes:
        platform: of the last advance; empty before the first.
        holder: the worker that is bound to it; empty if none is.
        has_state: the holder has its state.
        is_wanted: an advance is requested.
        number: of the job that is assigned; -1 if none is.
        is_whole: that job includes what is needed to rebuild the state.
        errors: number of workers that could not make the advance.
        failures: errors and losses since the last advance.
        avoid: workers that failed at the advance.
        lost: numbers of its jobs that got no reply, with the workers that had them.
        killed: workers that it crashed, with the causes.
        rests_until_s: end of the backoff [s].
        drifts_at_s: when it may drift to another platform [s].
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
    lost: dict[int, str] = field(default_factory=dict)
    killed: dict[str, str] = field(default_factory=dict)
    rests_until_s: float | None = None
    drifts_at_s: float | None = None


class ShardDispatch:
    """State machine of shards; events enter only through ``handle``."""

    def __init__(self, numbers: Iterator[int], *, allows_drift: bool = False) -> None:
        """Initialise without shards.

        Args:
            numbers: of jobs, each used once.
            allows_drift: a shard may move to another platform if its own is gone.
        """
        self._numbers = numbers
        self._allows_drift = allows_drift
        self._shards: dict[int, _Shard] = {}
        self._workers: dict[str, Joined] = {}
        self._out: dict[int, int] = {}
        self._now_s = 0.0

    @property
    def wake_s(self) -> float | None:
        """Time at which the next ``Ticked`` is needed [s]; None: it is not."""
        shards = self._shards.values()
        wakes = [*(s.rests_until_s for s in shards), *(s.drifts_at_s for s in shards)]
        # A shard that may drift by now waits for a worker, not for a time.
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

    @property
    def unassigned(self) -> int:
        """Number of advances that are requested and that no worker has."""
        return sum(
            shard.is_wanted and shard.number < 0 for shard in self._shards.values()
        )

    @property
    def assigned(self) -> int:
        """Number of advances that workers have."""
        return len(self._out)

    def holder(self, shard: int) -> str:
        """Return the name of the worker that holds a shard; empty if none does."""
        known = self._shards.get(shard)
        return known.holder if known else ""

    def shard_of(self, number: int) -> int | None:
        """Return the shard that a job advances at present."""
        return self._out.get(number)

    def shard_that_lost(self, number: int) -> int | None:
        """Return the shard whose present advance lost a job without reply."""
        for shard, state in self._shards.items():
            if number in state.lost:
                return shard
        return None

    def handle(self, event: ShardEvent) -> list[ShardCommand]:
        """Handle an event and return the commands, in order of execution.

        Late outcomes of a job, and workers that join or leave twice, change nothing.

        Raises:
            UnexpectedEvent: a second request for the same shard.
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
                return [*self._returned(event), *self._assignments()]
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
            raise UnexpectedEvent(f"shard {number}: is requested already")
        shard.is_wanted = True

    def _leave(self, agent: str) -> None:
        self._workers.pop(agent, None)
        for shard in self._shards.values():
            if shard.holder == agent:
                self._unbind(shard)

    def _unbind(self, shard: _Shard) -> None:
        if self._out.pop(shard.number, None) is not None:
            shard.lost[shard.number] = shard.holder
        shard.holder, shard.has_state, shard.number = "", False, -1

    def _tick(self, now_s: float) -> None:
        self._now_s = now_s
        for shard in self._shards.values():
            if shard.rests_until_s is not None and shard.rests_until_s <= now_s:
                shard.rests_until_s = None
            if self._allows_drift:
                self._wait(shard)

    def _wait(self, shard: _Shard) -> None:
        """Set when a shard without a worker of its platform may drift."""
        is_alone = shard.is_wanted and bool(shard.platform) and not self._equal(shard)
        if not is_alone:
            shard.drifts_at_s = None
        elif shard.drifts_at_s is None:
            shard.drifts_at_s = self._now_s + DRIFT_S

    def _returned(self, event: ShardReturned) -> list[ShardCommand]:
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
            shard.lost[event.number] = agent
        shard.avoid = (*shard.avoid, agent)
        shard.rests_until_s = self._now_s + min(
            REST_S * 2**shard.failures, LONGEST_REST_S
        )
        shard.failures += 1
        shard.errors += event.outcome != "lost"
        if shard.errors < MAX_ERRORS:
            return []
        reason = event.reason or "lacks the state that it was given"
        return self._give_up(number, agent, reason)

    def _killed(self, event: Killed) -> list[ShardCommand]:
        number = self.shard_that_lost(event.number)
        if number is None:
            return []
        if self._shards[number].lost[event.number] != event.agent:
            # A job crashes only a process that had it.
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
        """Give up a shard's advance."""
        shard = self._shards[number]
        shard.is_wanted = False
        self._forgive(shard)
        return [ShardFailed(number, agent, reason)]

    def _forgive(self, shard: _Shard) -> None:
        """Forget the failures at an advance that has ended."""
        shard.errors, shard.avoid, shard.lost, shard.killed = 0, (), {}, {}

    def _assignments(self) -> Iterator[ShardCommand]:
        """Assign the shards that wait and have a worker."""
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
        """Return the best worker for a shard; those that failed come last."""
        fit = self._fit(shard)
        fresh = [name for name in fit if name not in shard.avoid]
        holders = [each.holder for each in self._shards.values()]
        return min(
            fresh or fit, key=lambda name: (holders.count(name), name), default=""
        )
