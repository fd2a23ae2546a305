"""Agents of one kind, their load, the jobs that wait for them, and how long jobs take.

Jobs and advances of arenas share one account of load, one backoff, one judgement of
which agents are silent, and one rule for deadlines.
"""

from collections.abc import Callable, Hashable, Iterator
from dataclasses import dataclass, field
from heapq import heapify, heappop, heappush
from itertools import count
from math import inf
from typing import Literal

from coordinator.dispatch.events import Client, Job, Joined, Overdue

MOST_AHEAD = 16
"""Most jobs that an agent holds beyond the one that is always ready."""
AHEAD_S = 0.8
"""Most time that these jobs may take together [s]: other agents cannot have them."""
PAUSE_S = 0.2
"""Longest time that the coordinator lets answers collect [s]."""
SPARE_SHARE = 0.4
"""Share of the time of an agent's spare jobs for which answers may collect."""
BACKOFF_S = 0.05
LONGEST_BACKOFF_S = 3.2
REPLY_S = 5.0
"""Longest time that an agent has to report progress when it is asked [s]."""
_NEWEST_WEIGHT = 0.1
"""Weight of the newest value in a moving average."""
PATIENCE = 4.0
"""A job is late after this multiple of the typical duration of its kind."""
FIRST_S = 60.0
"""Longest deadline of a job without history [s]."""
FIRST_SPEED = 10.0
"""Its deadline is that of a simulation this much faster than real time."""
LONGEST_WAIT_S = 7 * 24 * 3600.0
"""Effectively no limit: a week is longer than any job [s]."""
LEAST_WAIT_S = 300.0
"""Least time for which the network waits for a reply [s]."""
_WAIT = 100.0
"""That time as a multiple of the typical duration."""
_WAIT_GROWTH = 10.0
"""Growth of that time with each request that is sent again."""
LOOK_S = 0.2
"""Interval between checks for late jobs [s]."""
_PROVIDED = 1e6
"""Above the load of any agent that needs jobs."""

Verdict = Literal["in time", "ask", "silent"]


@dataclass(slots=True)
class Pending:
    """A job that is not delivered yet.

    Attributes:
        holders: agents that have it, several if the first is late, in order: time of
            assignment [s], and its place in the queue of a slot (1.0 is first).
        errors: number of agents that could not do it.
        avoid: agents that failed at it.
        repeated: agents that were sent it again after the wait for their reply.
        lost: agents that had it and gave no reply, with its number then.
        earlier: numbers that it had before, as an advance.
        has_been_assigned: whether an agent has had it, as an advance.
        killed: processes that it crashed, with the causes.
    """

    job: Job
    holders: dict[str, tuple[float, float]] = field(default_factory=dict)
    errors: int = 0
    avoid: tuple[str, ...] = ()
    repeated: set[str] = field(default_factory=set)
    lost: set[tuple[int, str]] = field(default_factory=set)
    earlier: list[int] = field(default_factory=list)
    has_been_assigned: bool = False
    killed: dict[str, str] = field(default_factory=dict)


@dataclass(slots=True)
class AgentState:
    """An agent and its jobs.

    Attributes:
        held: its jobs by number, oldest first, delivered ones included.
        advances: its advances of arenas by number, moved ones included.
        busy: slots that these occupy; jobs get the next one, so that they never starve.
        job_s: typical time that a slot takes for a job [s]; 0 before the first.
        most_ahead: most jobs that it holds ahead; fewer if it is slow, as they wait
            for it.
        failures: errors and losses since its last answer.
        is_backing_off: it gets no jobs until its backoff ends.
        stamp: of its only valid entry in the pool's heap.
        worked_s: time of its last report of progress [s].
        asked_s: time of the last question about it [s].
        is_silent: it is silent until its next answer or report. Its jobs go to others,
            and it gets no more while it holds any; later ones go to others, too.
        is_told: the user knows that it is silent.
        unfit_for: clients whose jobs it cannot do, and why.
    """

    joined: Joined
    held: dict[int, Pending] = field(default_factory=dict)
    advances: dict[int, Pending] = field(default_factory=dict)
    busy: int = 0
    job_s: float = 0.0
    most_ahead: int = 0
    failures: int = 0
    is_backing_off: bool = False
    stamp: int = 0
    worked_s: float = -inf
    asked_s: float = -inf
    is_silent: bool = False
    is_told: bool = False
    unfit_for: dict[Client, str] = field(default_factory=dict)

    def occupy(self) -> None:
        """Update the number of slots that its advances occupy."""
        self.busy = min(len(self.advances), self.joined.slots)

    @property
    def is_away(self) -> bool:
        """It backs off or is silent."""
        return self.is_backing_off or self.is_silent

    def learn(self, duration_s: float) -> None:
        """Note the time that a slot took for a job [s]."""
        known = self.job_s or duration_s
        self.job_s = known + _NEWEST_WEIGHT * (duration_s - known)
        if self.job_s:
            self.most_ahead = min(MOST_AHEAD, int(AHEAD_S / self.job_s))


@dataclass(slots=True)
class Pool:
    """All agents of one kind and the jobs that wait for them.

    Attributes:
        at_hand: jobs beyond its slots that an agent always holds.
        free: (load, name, stamp) of each agent that may have jobs, a heap; entries with
            an old stamp are invalid.
        waiting: jobs that no agent has, or silent ones only, by number.
    """

    at_hand: int = 1
    agents: dict[str, AgentState] = field(default_factory=dict)
    free: list[tuple[float, str, int]] = field(default_factory=list)
    waiting: dict[int, Pending] = field(default_factory=dict)
    # Heaps of numbers. Jobs that some agent may not have are set aside: agents look at
    # each group once, not at each job. Jobs that wait no more are skipped.
    _order: list[int] = field(default_factory=list)
    _aside: dict[tuple[Client, tuple[str, ...]], list[int]] = field(
        default_factory=dict
    )
    _backoffs: list[tuple[float, int, str]] = field(default_factory=list)
    _stamps: Iterator[int] = field(default_factory=lambda: count(1))

    @property
    def wake_s(self) -> float | None:
        """Time at which the next backoff ends [s]; None if there is none."""
        return self._backoffs[0][0] if self._backoffs else None

    def back_off(self, name: str, now_s: float) -> None:
        """Start the backoff of an agent that failed, unless it has begun already."""
        agent = self.agents[name]
        if agent.is_backing_off:
            return
        agent.is_backing_off = True
        backoff_s = min(BACKOFF_S * 2 ** min(agent.failures, 10), LONGEST_BACKOFF_S)
        agent.failures += 1
        heappush(self._backoffs, (now_s + backoff_s, next(self._stamps), name))

    def end_backoffs(self, now_s: float) -> bool:
        """End the backoffs that are over; return whether there were any."""
        is_any = False
        while self._backoffs and self._backoffs[0][0] <= now_s:
            _, _, name = heappop(self._backoffs)
            if name in self.agents:
                self.agents[name].is_backing_off = False
                self.offer(name)
                is_any = True
        return is_any

    def judge(self, name: str, since_s: float, limit_s: float, now_s: float) -> Verdict:
        """Return whether an agent is silent, or must be asked for its progress first.

        An agent is silent if a job is past its deadline and the agent, asked since
        then, has not reported progress in time. A report restarts the deadline.

        ``since_s``: time at which it was given the job [s]. ``limit_s``: how long such
        a job may take, and how long the agent may take to report, up to ``REPLY_S``
        [s].
        """
        agent = self.agents[name]
        due_s = max(since_s, agent.worked_s) + limit_s
        if now_s < due_s:
            return "in time"
        # An old verdict does not count: the agent may work again.
        if agent.asked_s < max(due_s, now_s - 2.0 * REPLY_S):
            agent.asked_s = now_s
            return "ask"
        if now_s < agent.asked_s + min(REPLY_S, limit_s):
            return "in time"
        if not agent.is_silent:
            agent.is_silent = True
            self.offer(name)
        return "silent"

    def hear(self, name: str) -> None:
        """Note an answer or a report of progress: a silent agent has its jobs again."""
        agent = self.agents[name]
        if agent.is_silent:
            agent.is_silent = agent.is_told = False
            for number in agent.held:
                self.drop(number)
            self.offer(name)

    def tell(self, name: str, waited_s: float, to: str = "") -> Iterator[Overdue]:
        """Yield the line about a silent agent, once for each silence."""
        agent = self.agents[name]
        if not agent.is_told:
            agent.is_told = True
            yield Overdue(name, waited_s, to)

    def offer(self, name: str) -> None:
        """Note the load of an agent; its earlier entry becomes invalid."""
        agent = self.agents[name]
        agent.stamp = next(self._stamps)
        if agent.is_backing_off or (agent.is_silent and agent.held):
            return
        if len(self.free) > 4 * len(self.agents) + 64:
            self.free = [entry for entry in self.free if self._is_live(entry)]
            heapify(self.free)
        heappush(self.free, (self._load(agent), name, agent.stamp))

    def _load(self, agent: AgentState) -> float:
        """Return the load of an agent; 0 is idle.

        Agents with fewer jobs than they must hold come first. The others are loaded
        by the share of the jobs ahead that they hold.
        """
        spare = self._spare(agent)
        if spare < 0:
            return (len(agent.held) + agent.busy) / agent.joined.slots
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
        return len(agent.held) + agent.busy - agent.joined.slots - self.at_hand

    def _ahead(self, agent: AgentState) -> int:
        """Return how many jobs beyond that an agent may have: fewer near the end.

        Only half of the waiting jobs are assigned ahead, so that the last ones go to
        the agents that finish first.
        """
        return min(agent.most_ahead, len(self.waiting) // (2 * len(self.agents)))

    @property
    def pause_s(self) -> float:
        """Time for which answers may collect before some agent runs out of jobs [s].

        A small share of the time that the spare jobs of the first such agent take:
        jobs differ, and handling the collected answers takes time, too.
        """
        name = self._least_busy()
        if not name or self._spare(self.agents[name]) <= 0:
            return 0.0
        spare_s = min(
            self._spare(agent) / agent.joined.slots * agent.job_s
            for agent in self.agents.values()
            if not agent.is_away
        )
        return min(PAUSE_S, SPARE_SHARE * spare_s)

    def idle(self) -> list[str]:
        """Return the agents without a job, those that have done one before first."""
        if not self._least_busy() or self.free[0][0] > 0.0:
            return []
        idle = (
            (not agent.job_s, name)
            for name, agent in self.agents.items()
            if not (agent.held or agent.advances or agent.is_away)
        )
        return [name for _, name in sorted(idle)]

    def _is_live(self, entry: tuple[float, str, int]) -> bool:
        agent = self.agents.get(entry[1])
        return agent is not None and agent.stamp == entry[2]

    def fit(self, client: Client) -> Iterator[str]:
        """Yield the names of the agents that can do a client's jobs."""
        # A copy: the Python API counts them while another thread lets agents join.
        return (n for n, a in list(self.agents.items()) if client not in a.unfit_for)

    def may_take(self, name: str, client: Client, avoid: tuple[str, ...]) -> bool:
        """Return whether an agent may have a job that avoids some if others answer."""
        if client in self.agents[name].unfit_for:
            return False
        return name not in avoid or all(
            other in avoid or self.agents[other].is_silent for other in self.fit(client)
        )

    def wait(self, pending: Pending) -> None:
        """Add a job to those that wait, unless it is one."""
        number = pending.job.number
        if number not in self.waiting:
            self.waiting[number] = pending
            heappush(self._order, number)

    def take(
        self, name: str, avoided: Callable[[Pending], tuple[str, ...]]
    ) -> Pending | None:
        """Remove and return the first waiting job that an agent may have, if any.

        ``avoided``: returns the agents that a job avoids if there are others.
        """
        self._aside = {group: heap for group, heap in self._aside.items() if heap}
        aside = self._aside.items()
        heaps = [heap for group, heap in aside if self.may_take(name, *group)]
        heaps.append(self._order)
        while heap := min(filter(None, heaps), default=None):
            pending = self.waiting.get(heappop(heap))
            if pending is None:
                continue
            number, client = pending.job.number, pending.job.client
            group = client, avoided(pending)
            if self.may_take(name, *group):
                return self.waiting.pop(number)
            heappush(self._aside.setdefault(group, []), number)
        return None

    def drop(self, number: int) -> None:
        """Remove a job if it waits."""
        if self.waiting.pop(number, None) is None:
            return
        size = len(self._order) + sum(map(len, self._aside.values()))
        if size > 2 * len(self.waiting) + 64:
            self._order = sorted(self.waiting)
            self._aside.clear()


class PairedJobs:
    """Agents that were given one of two paired jobs; the other job avoids them."""

    def __init__(self) -> None:
        self._agents: dict[int, dict[str, None]] = {}

    def note(self, job: Job, agent: str) -> None:
        """Note that a job is assigned to an agent."""
        if job.paired >= 0:
            self._agents.setdefault(job.number, {})[agent] = None

    def avoided(self, pending: Pending) -> tuple[str, ...]:
        """Return the agents that a job avoids if there are others."""
        others = self._agents.get(pending.job.paired, {})
        return (*pending.avoid, *(each for each in others if each not in pending.avoid))

    def forget(self, job: Job) -> None:
        """Remove a pair, both jobs of which have ended."""
        self._agents.pop(job.number, None)
        self._agents.pop(job.paired, None)


class Deadlines:
    """Typical duration of jobs of each kind, for simulations per simulated second."""

    def __init__(self, least_s: float) -> None:
        """Initialise without history; no deadline is shorter than ``least_s`` [s]."""
        self._least_s = least_s
        self._typical_s: dict[Hashable, float] = {}

    def learn(self, kind: Hashable, took_s: float, simulated_s: float | None) -> None:
        """Note the duration of a job, from its assignment."""
        each_s = took_s / _length(simulated_s)
        known = self._typical_s.get(kind, each_s)
        self._typical_s[kind] = known + _NEWEST_WEIGHT * (each_s - known)

    def forget(self, kind: Hashable) -> None:
        """Drop the history of a kind of jobs that has ended."""
        self._typical_s.pop(kind, None)

    def limit_s(self, kind: Hashable, simulated_s: float | None) -> float:
        """Return how long a job may take [s]."""
        limit_s = FIRST_S
        if kind in self._typical_s:
            limit_s = PATIENCE * self._typical_s[kind] * _length(simulated_s)
        elif simulated_s is not None:
            limit_s = min(FIRST_S, simulated_s / FIRST_SPEED)
        return max(self._least_s, limit_s)

    def wait_s(self, kind: Hashable, simulated_s: float | None) -> float:
        """Return for how long the network waits for a reply [s].

        The network holds some memory of each request until this time is over, even if
        the reply came long ago: half a kilobyte, three times per birth, once per call.
        A request whose time is over is sent again, see ``longer_s``.
        """
        if kind not in self._typical_s:
            return LONGEST_WAIT_S
        typical_s = self._typical_s[kind] * _length(simulated_s)
        return min(LONGEST_WAIT_S, max(LEAST_WAIT_S, _WAIT * typical_s))


def _length(simulated_s: float | None) -> float:
    """Return how long a job is; what does not simulate outweighs the first second."""
    return max(1.0, simulated_s or 0.0)


def longer_s(wait_s: float) -> float:
    """Return for how long to wait for a reply that did not come in some time [s]."""
    return min(LONGEST_WAIT_S, _WAIT_GROWTH * wait_s)
