"""Agents of one kind, their load, and the jobs that wait for them."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from heapq import heapify, heappop, heappush
from itertools import count
from math import inf

from coordinator.dispatch.events import Job, JobKind, Joined

MOST_AHEAD = 16
"""Most jobs that an agent holds beyond the one that is always ready."""
AHEAD_S = 0.8
"""Most time that these jobs may take together [s]: other agents cannot have them."""
PAUSE_S = 0.2
"""Longest time that the coordinator lets answers collect [s]."""
_NEWEST_WEIGHT = 0.1
_PROVIDED = 1e6
"""Above the load of any agent that needs jobs."""


@dataclass(slots=True)
class Pending:
    """A job that is not delivered yet.

    Attributes:
        job: the job.
        holders: agents that have it, two if the first is late: time of assignment
            [s], and its place in the queue of a slot (1.0 is first).
        errors: number of agents that could not do it.
        avoid: agents that failed at it.
        lost: agents that had it and gave no reply.
        killed: processes that it crashed, with the causes.
    """

    job: Job
    holders: dict[str, tuple[float, float]] = field(default_factory=dict)
    errors: int = 0
    avoid: tuple[str, ...] = ()
    lost: dict[str, None] = field(default_factory=dict)
    killed: dict[str, str] = field(default_factory=dict)

    @property
    def since_s(self) -> float:
        """Time of the first assignment that still holds [s]."""
        return min(since_s for since_s, _ in self.holders.values())


@dataclass(slots=True)
class AgentState:
    """An agent and its jobs.

    Attributes:
        joined: its properties.
        held: numbers of its jobs, oldest first.
        job_s: typical time that a slot takes for a job [s]; 0 before the first.
        failures: errors and losses since its last answer.
        rests: it gets no jobs until its backoff ends.
        stamp: of its only valid entry in the pool's heap.
    """

    joined: Joined
    held: dict[int, None] = field(default_factory=dict)
    job_s: float = 0.0
    failures: int = 0
    rests: bool = False
    stamp: int = 0

    def learn(self, duration_s: float) -> None:
        """Note the time that a slot took for a job [s]."""
        known = self.job_s or duration_s
        self.job_s = known + _NEWEST_WEIGHT * (duration_s - known)

    @property
    def most_ahead(self) -> int:
        """Most jobs that it holds ahead; fewer if it is slow, as they wait for it."""
        return min(MOST_AHEAD, int(AHEAD_S / self.job_s)) if self.job_s else 0


@dataclass(slots=True)
class Pool:
    """All agents of one kind and the jobs that wait for them.

    Attributes:
        at_hand: jobs beyond its slots that an agent always holds.
        agents: by their names.
        free: (load, name, stamp) of each agent that does not rest, a heap; entries
            with an old stamp are invalid.
        waiting: numbers of jobs, a heap.
    """

    at_hand: int = 1
    agents: dict[str, AgentState] = field(default_factory=dict)
    free: list[tuple[float, str, int]] = field(default_factory=list)
    waiting: list[int] = field(default_factory=list)

    def offer(self, name: str, stamp: int) -> None:
        """Note the load of an agent; its earlier entry becomes invalid."""
        agent = self.agents[name]
        agent.stamp = stamp
        if agent.rests:
            return
        if len(self.free) > 4 * len(self.agents) + 64:
            self.free = [entry for entry in self.free if self._is_live(entry)]
            heapify(self.free)
        heappush(self.free, (self._load(agent), name, stamp))

    def _load(self, agent: AgentState) -> float:
        """Return the load of an agent; 0 is idle.

        Agents with fewer jobs than they must hold come first. The others are loaded
        by the share of the jobs ahead that they hold.
        """
        spare = self._spare(agent)
        if spare < 0:
            return len(agent.held) / agent.joined.slots
        return _PROVIDED + (spare / agent.most_ahead if agent.most_ahead else inf)

    def best(self) -> str:
        """Return the least busy agent if it may have another job, else ""."""
        name = self._least_busy()
        if not name:
            return ""
        agent = self.agents[name]
        return name if self._spare(agent) < self._ahead(agent) else ""

    def _least_busy(self) -> str:
        while self.free:
            if self._is_live(self.free[0]):
                return self.free[0][1]
            heappop(self.free)
        return ""

    def _spare(self, agent: AgentState) -> int:
        """Return how many jobs an agent has beyond those it must hold."""
        return len(agent.held) - agent.joined.slots - self.at_hand

    def _ahead(self, agent: AgentState) -> int:
        """Return how many jobs beyond that an agent may have: fewer near the end.

        Only half of the waiting jobs are assigned ahead, so that the last ones go to
        the agents that finish first.
        """
        return min(agent.most_ahead, len(self.waiting) // (2 * len(self.agents)))

    @property
    def leisure_s(self) -> float:
        """Estimated time until some agent runs out of jobs [s].

        Half of the time that the spare jobs of the first such agent take, as jobs
        differ.
        """
        name = self._least_busy()
        if not name or self._spare(self.agents[name]) <= 0:
            return 0.0
        spare_s = min(
            self._spare(agent) / agent.joined.slots * agent.job_s
            for agent in self.agents.values()
            if not agent.rests
        )
        return min(PAUSE_S, spare_s / 2)

    def idle(self) -> list[str]:
        """Return the agents without a job that do not rest, by name."""
        if not self._least_busy() or self.free[0][0] > 0.0:
            return []
        return sorted(
            name
            for name, agent in self.agents.items()
            if not agent.held and not agent.rests
        )

    def _is_live(self, entry: tuple[float, str, int]) -> bool:
        agent = self.agents.get(entry[1])
        return agent is not None and agent.stamp == entry[2]

    def may_take(self, name: str, avoid: tuple[str, ...]) -> bool:
        """Return whether an agent may have a job that avoids others where it can."""
        if name not in avoid:
            return True
        return sum(other in self.agents for other in avoid) == len(self.agents)

    def take(
        self,
        name: str,
        jobs: Mapping[int, Pending],
        avoided: Callable[[Pending], tuple[str, ...]],
    ) -> Pending | None:
        """Remove and return the first waiting job that an agent may have, if any.

        Args:
            name: of the agent.
            jobs: by their numbers.
            avoided: returns the agents that a job avoids if there are others.
        """
        passed: list[int] = []
        taken: Pending | None = None
        while self.waiting and taken is None:
            number = heappop(self.waiting)
            pending = jobs[number]
            if self.may_take(name, avoided(pending)):
                taken = pending
            else:
                passed.append(number)
        for number in passed:
            heappush(self.waiting, number)
        return taken

    def drop(self, number: int) -> None:
        """Remove a waiting job."""
        self.waiting.remove(number)
        heapify(self.waiting)


REST_S = 0.05
LONGEST_REST_S = 3.2


class Backoff:
    """Backoff of agents that failed."""

    def __init__(self) -> None:
        self._until: list[tuple[float, int, str]] = []
        self._order = count()

    @property
    def wake_s(self) -> float | None:
        """Time at which the next rest ends [s]; None if there is none."""
        return self._until[0][0] if self._until else None

    def begin(self, agent: AgentState, now_s: float) -> None:
        """Start the rest of an agent, unless it rests already."""
        if agent.rests:
            return
        agent.rests = True
        rest_s = min(REST_S * 2**agent.failures, LONGEST_REST_S)
        agent.failures += 1
        heappush(self._until, (now_s + rest_s, next(self._order), agent.joined.agent))

    def over(self, now_s: float) -> Iterator[str]:
        """Yield the agents whose rest is over; some may have left."""
        while self._until and self._until[0][0] <= now_s:
            yield heappop(self._until)[2]


class PairedJobs:
    """Agents that were given a job whose twin another agent is to do."""

    def __init__(self) -> None:
        self._agents: dict[int, dict[str, None]] = {}

    def note(self, job: Job, agent: str) -> None:
        """Note that a job is assigned to an agent."""
        if job.twin >= 0:
            self._agents.setdefault(job.number, {})[agent] = None

    def avoided(self, pending: Pending) -> tuple[str, ...]:
        """Return the agents that a job avoids if there are others."""
        others = self._agents.get(pending.job.twin)
        if not others:
            return pending.avoid
        return (*pending.avoid, *(each for each in others if each not in pending.avoid))

    def forget(self, job: Job) -> None:
        """Remove a pair, both jobs of which have ended."""
        self._agents.pop(job.number, None)
        self._agents.pop(job.twin, None)


PATIENCE = 4.0
"""A job is late after this multiple of the typical duration of its kind."""
LEAST_S = 1.0
"""A job is never late before this time [s]: a second copy would cost more."""
LOOK_S = 0.25
"""Interval between checks for late jobs [s]."""


class Stragglers:
    """Typical duration of the jobs of each kind, from their assignment [s]."""

    def __init__(self) -> None:
        self._typical_s: dict[JobKind, float] = {}
        self._next_look_s = 0.0

    def learn(self, kind: JobKind, duration_s: float) -> None:
        """Note the duration of a job."""
        known = self._typical_s.get(kind, duration_s)
        self._typical_s[kind] = known + _NEWEST_WEIGHT * (duration_s - known)

    def is_time(self, now_s: float) -> bool:
        """Return whether a check for late jobs is due; starts the next interval."""
        if now_s < self._next_look_s:
            return False
        self._next_look_s = now_s + LOOK_S
        return True

    def is_late(self, kind: JobKind, elapsed_s: float) -> bool:
        """Return whether an assigned job is late; False before one was done."""
        typical_s = self._typical_s.get(kind)
        if typical_s is None:
            return False
        return elapsed_s > max(LEAST_S, PATIENCE * typical_s)
