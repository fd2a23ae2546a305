"""Who gets which job: a pure machine between those who ask and those who do.

Each requested job is delivered exactly once, whatever joins, leaves, dies, errs
or answers late. An agent holds at most ``slots + 1`` jobs, so that the next one
is always at hand. Lower numbers go first, and so what was lost goes first again;
the agent with the least to do gets it, ties break on its name.

An agent that erred or lost a job without leaving rests before it is given more,
longer each time in a row, so that a broken one cannot eat the queue.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from heapq import heappop, heappush
from itertools import count

from coordinator.events import (
    AgentKind,
    Assign,
    Deliver,
    DispatchCommand,
    DispatchEvent,
    Job,
    JobKind,
    Joined,
    Left,
    Requested,
    Returned,
    Ticked,
)
from coordinator.pool import AgentState, Pool
from schema.errors import UnexpectedEvent

AGENT_OF: dict[JobKind, AgentKind] = {"vet": "analyzer", "evaluate": "worker"}
MAX_ERRORS = 3
REST_S = 0.05
LONGEST_REST_S = 3.2


@dataclass(slots=True)
class _Pending:
    """A job that is not delivered yet; ``avoid`` are those who failed on it."""

    job: Job
    holder: str = ""
    errors: int = 0
    avoid: tuple[str, ...] = ()


class Dispatch:
    """The machine; ``handle`` is its only door."""

    def __init__(self) -> None:
        self._jobs: dict[int, _Pending] = {}
        self._pools: dict[AgentKind, Pool] = {"worker": Pool(), "analyzer": Pool()}
        self._kind_of: dict[str, AgentKind] = {}
        self._resting: list[tuple[float, str, int]] = []
        self._stamps = count(1)
        self._highest = -1
        self._now_s: float | None = None
        self._doors: dict[type, Callable[..., Iterator[DispatchCommand]]] = {
            Joined: self._joined,
            Left: self._left,
            Requested: self._requested,
            Returned: self._returned,
            Ticked: self._ticked,
        }

    @property
    def pending(self) -> int:
        """How many jobs are asked for and not delivered."""
        return len(self._jobs)

    def agents(self, kind: AgentKind) -> int:
        """Return how many agents of a kind are there."""
        return len(self._pools[kind].agents)

    def waiting(self, kind: AgentKind) -> int:
        """Return how many jobs no agent of their kind has taken yet."""
        return len(self._pools[kind].waiting)

    def platform(self, agent: str) -> str:
        """Return what an agent's machine is; empty once it has left."""
        kind = self._kind_of.get(agent)
        return self._pools[kind].agents[agent].joined.platform if kind else ""

    @property
    def wake_s(self) -> float | None:
        """When the next ``Ticked`` can change something [s]; None: no need."""
        return self._resting[0][0] if self._resting else None

    def handle(self, event: DispatchEvent) -> list[DispatchCommand]:
        """Take an event and return what is to be done, in this order.

        Late answers, second answers and whoever joins or leaves twice change
        nothing.

        Raises:
            UnexpectedEvent: a job number that does not ascend or that names
                another job, an agent with less than one slot or that joins as
                another than it is, a clock that runs backwards.
        """
        return list(self._doors[type(event)](event))

    def _joined(self, event: Joined) -> Iterator[DispatchCommand]:
        if event.slots < 1:
            raise UnexpectedEvent(f"{event.agent}: slots must be >= 1: {event.slots}")
        if kind := self._kind_of.get(event.agent):
            known = self._pools[kind].agents[event.agent].joined
            if known != event:
                raise UnexpectedEvent(f"joins as {event}, is there as {known}")
            return
        pool = self._pools[event.kind]
        self._kind_of[event.agent] = event.kind
        pool.agents[event.agent] = AgentState(event)
        pool.offer(event.agent, next(self._stamps))
        yield from self._assign(pool)

    def _left(self, event: Left) -> Iterator[DispatchCommand]:
        kind = self._kind_of.pop(event.agent, None)
        if kind is None:
            return
        pool = self._pools[kind]
        for number in pool.agents.pop(event.agent).held:
            self._jobs[number].holder = ""
            heappush(pool.waiting, number)
        yield from self._assign(pool)

    def _requested(self, event: Requested) -> Iterator[DispatchCommand]:
        number = event.job.number
        if (known := self._jobs.get(number)) and known.job == event.job:
            return
        if number <= self._highest:
            raise UnexpectedEvent(
                f"job numbers must ascend: got {number} after {self._highest}"
            )
        pool = self._pools[AGENT_OF[event.job.kind]]
        self._highest = number
        self._jobs[number] = _Pending(event.job)
        heappush(pool.waiting, number)
        yield from self._assign(pool)

    def _returned(self, event: Returned) -> Iterator[DispatchCommand]:
        pending = self._jobs.get(event.number)
        if pending is None or not pending.holder or pending.holder != event.agent:
            return
        pool = self._pools[AGENT_OF[pending.job.kind]]
        agent = pool.agents[event.agent]
        del agent.held[event.number]
        pending.holder = ""
        pending.errors += event.outcome == "error"
        if event.outcome == "ok" or pending.errors == MAX_ERRORS:
            del self._jobs[event.number]
            yield Deliver(pending.job, event.agent, event.answer, event.reason)
        else:
            if event.agent not in pending.avoid:
                pending.avoid = (*pending.avoid, event.agent)
            heappush(pool.waiting, event.number)
        if event.outcome == "ok":
            agent.failures = 0
        else:
            self._rest(agent)
        pool.offer(event.agent, next(self._stamps))
        yield from self._assign(pool)

    def _rest(self, agent: AgentState) -> None:
        """Give an agent nothing for a while; one rest at a time."""
        if agent.rests:
            return
        agent.rests = True
        rest_s = min(REST_S * 2**agent.failures, LONGEST_REST_S)
        agent.failures += 1
        until_s = (self._now_s or 0.0) + rest_s
        heappush(self._resting, (until_s, agent.joined.agent, next(self._stamps)))

    def _ticked(self, event: Ticked) -> Iterator[DispatchCommand]:
        if self._now_s is not None and event.now_s < self._now_s:
            raise UnexpectedEvent(f"{event.now_s} s comes after {self._now_s} s")
        self._now_s = event.now_s
        while self._resting and self._resting[0][0] <= event.now_s:
            name = heappop(self._resting)[1]
            if kind := self._kind_of.get(name):
                pool = self._pools[kind]
                pool.agents[name].rests = False
                pool.offer(name, next(self._stamps))
                yield from self._assign(pool)

    def _assign(self, pool: Pool) -> Iterator[DispatchCommand]:
        """Give out what can be given out."""
        passed: list[str] = []
        while pool.waiting and (name := pool.best()):
            pending = self._take(pool, name)
            if pending is None:
                passed.append(name)
                heappop(pool.free)
                continue
            pending.holder = name
            pool.agents[name].held[pending.job.number] = None
            pool.offer(name, next(self._stamps))
            yield Assign(pending.job, name)
        for name in passed:
            pool.offer(name, next(self._stamps))

    def _take(self, pool: Pool, name: str) -> _Pending | None:
        """Take the first waiting job that may go to an agent, if there is one."""
        passed: list[int] = []
        taken: _Pending | None = None
        while pool.waiting and taken is None:
            number = heappop(pool.waiting)
            pending = self._jobs[number]
            if pool.may_take(name, pending.avoid):
                taken = pending
            else:
                passed.append(number)
        for number in passed:
            heappush(pool.waiting, number)
        return taken
