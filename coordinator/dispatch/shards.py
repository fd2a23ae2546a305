"""State machine that assigns arena shards to workers.

One worker holds the state of a shard and makes its advances. If that worker is gone,
fails, lacks the state or is silent, the advance goes, with all that is needed to
rebuild the state, to another worker of an equal platform: one that keeps more states
than it has, with the lowest load; ties break on the name. A worker that is unfit for
the shard's client never gets it. A shard without a worker waits. If the user allows a
drift, one of another platform gets it after a while.

An advance has a deadline. A silent worker loses it to one that has room. If that one
had it before, the deadline is twice as long, so that an advance that takes long
everywhere ends. A worker that joins takes over shards of those that hold more.
"""

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

from coordinator.dispatch.events import (
    NO_CLIENT,
    AskProgress,
    AssignShard,
    CancelShard,
    Client,
    Crowded,
    Expired,
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
from coordinator.dispatch.pool import LONGEST_WAIT_S, LOOK_S, Deadlines, Pool
from schema.errors import UnexpectedEvent

MAX_ERRORS = 3
_MOST_DOUBLINGS = 16
DRIFT_S = 30.0
"""Time that a shard waits for its own platform before it may drift [s]."""
LEAST_S = 2.0
"""An advance is never late before this time [s]: to rebuild a state is expensive."""


@dataclass(slots=True)
class _Shard:
    """A shard and its present advance.

    Attributes:
        client: the run of the arena.
        platform: of the last advance; empty before the first.
        holder: the worker that is bound to it; empty if none is.
        successor: the worker that takes over after the present advance; empty if none
            does.
        has_state: the holder has its state.
        is_wanted: an advance is requested.
        simulated_s: of that request.
        number: of the job that is assigned; -1 if none is.
        is_whole: that job includes what is needed to rebuild the state.
        since_s: time at which that job was assigned [s].
        misses: how often the advance moved to a worker that had it before.
        errors: number of workers that could not make the advance.
        avoid: workers that failed at the advance.
        lost: numbers of its jobs that got no reply, with the workers that had them.
        killed: workers that it crashed, with the causes.
        drifts_at_s: when it may drift to another platform [s].
    """

    client: Client = NO_CLIENT
    platform: str = ""
    holder: str = ""
    successor: str = ""
    has_state: bool = False
    is_wanted: bool = False
    simulated_s: float | None = None
    may_drift: bool = True
    number: int = -1
    is_whole: bool = False
    since_s: float = 0.0
    misses: int = 0
    errors: int = 0
    avoid: tuple[str, ...] = ()
    lost: dict[int, str] = field(default_factory=dict)
    killed: dict[str, str] = field(default_factory=dict)
    drifts_at_s: float | None = None


class ShardDispatch:
    """State machine of shards; events enter only through ``handle``.

    ``Dispatch`` handles events that both take first: who joins, who leaves, the time.

    Attributes:
        rebuilt: number of assigned advances that start from a rebuilt state.
    """

    def __init__(
        self, numbers: Iterator[int], workers: Pool, *, allows_drift: bool = False
    ) -> None:
        """Initialise without shards.

        Args:
            numbers: of jobs, each used once.
            workers: of ``Dispatch``; their load includes advances.
            allows_drift: a shard may move to another platform if its own is gone.
        """
        self.rebuilt = 0
        self._numbers = numbers
        self._allows_drift = allows_drift
        self._shards: dict[int, _Shard] = {}
        self._workers = workers
        self._deadlines = Deadlines(LEAST_S)
        self._out: dict[int, int] = {}
        self._now_s = self._next_look_s = 0.0
        self._is_crowded = False

    @property
    def wake_s(self) -> float | None:
        """Time at which the next ``Ticked`` is needed [s]; None: it is not."""
        wakes = (shard.drifts_at_s for shard in self._shards.values())
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

    def wait_s(self, job: AssignShard) -> float:
        """Return for how long the network waits for the reply to an advance [s]."""
        # A rebuild may take very much longer than an advance.
        if job.is_whole:
            return LONGEST_WAIT_S
        simulated_s = self._shards[job.shard].simulated_s
        return self._deadlines.wait_s(job.shard, simulated_s)

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
                return list(self._joined(event))
            case Left():
                self._leave(event.agent)
            case Ticked():
                return [*self._tick(event.now_s), *self._assignments()]
            case ShardSeen():
                shard = self._shard(event.shard)
                shard.platform, shard.may_drift = event.platform, event.may_drift
                shard.client = event.client
            case ShardRequested():
                self._want(event)
            case Expired():
                self._expired(event.number)
            case ShardReturned():
                return [*self._returned(event), *self._assignments()]
            case Killed():
                return [*self._killed(event), *self._assignments()]
            case Released():
                self._unbind(self._shard(event.shard))
                self._deadlines.forget(event.shard)
                del self._shards[event.shard]
        return list(self._assignments())

    def _shard(self, number: int) -> _Shard:
        return self._shards.setdefault(number, _Shard())

    def _want(self, event: ShardRequested) -> None:
        shard = self._shard(event.shard)
        if shard.is_wanted:
            raise UnexpectedEvent(f"shard {event.shard}: is requested already")
        shard.is_wanted, shard.simulated_s = True, event.simulated_s

    def _joined(self, joined: Joined) -> Iterator[ShardCommand]:
        if joined.kind == "worker":
            yield from self._assignments()
            yield from self._share(joined)

    def _leave(self, agent: str) -> None:
        for shard in self._shards.values():
            if shard.successor == agent:
                shard.successor = ""
            if shard.holder == agent:
                self._unbind(shard)

    def _unbind(self, shard: _Shard) -> None:
        if self._out.pop(shard.number, None) is not None:
            shard.lost[shard.number] = shard.holder
        shard.holder, shard.successor = shard.successor, ""
        shard.has_state, shard.number = False, -1

    def _tick(self, now_s: float) -> Iterator[ShardCommand]:
        self._now_s = now_s
        for shard in self._shards.values():
            if self._allows_drift and shard.may_drift:
                self._wait(shard)
        if now_s >= self._next_look_s:
            self._next_look_s = now_s + LOOK_S
            yield from self._look()

    def _look(self) -> Iterator[ShardCommand]:
        """Move advances from silent workers to others with room."""
        pool, late = self._workers, list[tuple[int, _Shard]]()
        for number, shard in sorted(self._shards.items()):
            if shard.number < 0:
                continue
            limit_s = self._deadlines.limit_s(number, shard.simulated_s)
            limit_s *= 2 ** min(shard.misses, _MOST_DOUBLINGS)
            verdict = pool.judge(shard.holder, shard.since_s, limit_s, self._now_s)
            if verdict == "ask":
                yield AskProgress(shard.holder)
            elif verdict == "silent":
                late.append((number, shard))
        for number, shard in late:
            crowding = self._crowding()
            free = (n for n in self._fit(shard) if crowding(n)[:2] == (False, False))
            to = min(free, key=crowding, default="")
            yield from pool.tell(shard.holder, self._now_s - shard.since_s, to)
            if to:
                shard.misses += to in shard.avoid
                shard.avoid = (*shard.avoid, shard.holder)
                yield from self._move(number, to)

    def _move(self, number: int, to: str) -> Iterator[ShardCommand]:
        """Take a shard from its worker, with the advance that is assigned."""
        shard = self._shards[number]
        if shard.number >= 0:
            yield CancelShard(shard.number, number, shard.holder)
        shard.successor = to
        self._unbind(shard)

    def _share(self, joined: Joined) -> Iterator[ShardCommand]:
        """Give a worker that has joined shards of those that hold more."""
        to = joined.agent
        agents = self._workers.agents
        while True:
            bound = self._bound()
            places = {
                number: shard.successor or shard.holder
                for number, shard in self._shards.items()
                if shard.holder and to in self._fit(shard)
            }
            # What its present worker would keep; those without a state are cheap.
            fit = (
                ((bound[name] - 1) / agents[name].joined.cores, number)
                for number, name in places.items()
            )
            kept, number = max(
                fit, key=lambda f: (f[0], not self._shards[f[1]].has_state, f[1]),
                default=(0.0, 0),
            )  # fmt: skip
            share = (bound[to] + 1) / joined.cores
            if bound[to] >= joined.shards or kept < share:
                return
            shard = self._shards[number]
            if shard.has_state and shard.number >= 0:
                shard.successor = to
            else:
                yield from self._move(number, to)
                yield from self._assignments()

    def _wait(self, shard: _Shard) -> None:
        """Set the time from which a shard that waits may drift.

        It has none while a worker of its platform is connected.
        """
        is_alone = shard.is_wanted and bool(shard.platform) and not self._equal(shard)
        if not is_alone:
            shard.drifts_at_s = None
        elif shard.drifts_at_s is None:
            shard.drifts_at_s = self._now_s + DRIFT_S

    def _expired(self, number: int) -> None:
        """Learn how long an advance has taken so far: it may wait in a queue.

        The next ones then wait longer, also if this one ends in another way.
        """
        if (shard := self._out.get(number)) is not None:
            self._learn(shard)

    def _learn(self, number: int) -> None:
        """Note how long a shard's advance took, or has taken so far."""
        shard = self._shards[number]
        if not shard.is_whole:
            took_s = self._now_s - shard.since_s
            self._deadlines.learn(number, took_s, shard.simulated_s)

    def _returned(self, event: ShardReturned) -> list[ShardCommand]:
        number = self._out.pop(event.number, None)
        if number is None:
            return []
        shard = self._shards[number]
        agent, shard.number = shard.holder, -1
        if event.outcome == "done":
            worker = self._workers.agents[agent]
            shard.platform, worker.failures = worker.joined.platform, 0
            shard.has_state, shard.is_wanted = True, False
            self._learn(number)
            self._forgive(shard)
            if shard.successor:
                self._unbind(shard)
            return [ShardDone(number, agent, event.answer)]
        if event.outcome == "stateless" and not shard.is_whole:
            shard.has_state = False
            return []
        self._unbind(shard)
        if event.outcome == "unsent":
            return self._give_up(number, "", event.reason)
        return self._failed(number, agent, event)

    def _failed(
        self, number: int, agent: str, event: ShardReturned
    ) -> list[ShardCommand]:
        """Note that a worker did not make an advance."""
        shard = self._shards[number]
        if event.outcome == "unfit":
            self._workers.agents[agent].unfit_for[shard.client] = event.reason
            return []
        if event.outcome == "lost":
            shard.lost[event.number] = agent
        shard.avoid = (*shard.avoid, agent)
        self._workers.back_off(agent, self._now_s)
        # A malformed answer is a fault of its worker alone.
        shard.errors += event.outcome not in ("lost", "malformed")
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
        shard.misses = 0

    def _assignments(self) -> Iterator[ShardCommand]:
        """Assign the shards that wait and have a worker."""
        for number, shard in sorted(self._shards.items()):
            if not shard.is_wanted or shard.number >= 0:
                continue
            if not shard.holder:
                shard.holder = self._choice(shard)
                yield from self._count()
            if shard.holder:
                yield self._assign(number, shard)

    def _count(self) -> Iterator[ShardCommand]:
        """Tell the user, once, if the workers cannot keep all shards."""
        kept = sum(a.joined.shards for a in self._workers.agents.values())
        bound = sum(bool(shard.holder) for shard in self._shards.values())
        if bound <= kept:
            self._is_crowded = False
        elif not self._is_crowded:
            self._is_crowded = True
            yield Crowded(bound, kept)

    def _assign(self, number: int, shard: _Shard) -> AssignShard:
        """Send a shard's advance to its holder."""
        worker = self._workers.agents[shard.holder]
        shard.drifts_at_s = None
        shard.number, shard.since_s = next(self._numbers), self._now_s
        shard.is_whole = not shard.has_state
        self.rebuilt += shard.is_whole and bool(shard.platform)
        self._out[shard.number] = number
        worker.advances[shard.number] = None
        worker.occupy()
        self._workers.offer(shard.holder)
        platform = worker.joined.platform
        return AssignShard(shard.number, number, shard.holder, platform, shard.is_whole)

    def _fit(self, shard: _Shard) -> list[str]:
        """Return the workers that may hold a shard, by name."""
        fit = self._equal(shard)
        if fit or shard.drifts_at_s is None or self._now_s < shard.drifts_at_s:
            return fit
        return sorted(self._workers.fit(shard.client))

    def _equal(self, shard: _Shard) -> list[str]:
        """Return the workers of a shard's platform, by name."""
        agents = self._workers.agents
        return [
            name
            for name in sorted(self._workers.fit(shard.client))
            if shard.platform in ("", agents[name].joined.platform)
        ]

    def _choice(self, shard: _Shard) -> str:
        """Return the best worker for a shard; "" if all are backing off.

        Workers that failed at the advance come last.
        """
        fit = self._fit(shard)
        fresh = [name for name in fit if name not in shard.avoid] or fit
        ready = (
            name for name in fresh if not self._workers.agents[name].is_backing_off
        )
        return min(ready, key=self._crowding(), default="")

    def _bound(self) -> Counter[str]:
        """Return how many shards each worker holds or takes over."""
        return Counter(
            shard.successor or shard.holder for shard in self._shards.values()
        )

    def _crowding(self) -> Callable[[str], tuple[bool, bool, float, int, str]]:
        """Return by what workers compare: the least one gets the next shard.

        Whether it is silent or backs off is first, then whether it holds as many as it
        keeps.
        """
        bound, agents = self._bound(), self._workers.agents

        def crowding(name: str) -> tuple[bool, bool, float, int, str]:
            worker = agents[name]
            is_full = bound[name] >= worker.joined.shards
            share = bound[name] / worker.joined.cores
            return worker.is_away, is_full, share, len(worker.held), name

        return crowding
