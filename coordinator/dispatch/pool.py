"""All agents of one kind, who has the least to do, and the jobs that wait for them."""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from heapq import heapify, heappop, heappush
from itertools import count
from math import inf

from coordinator.dispatch.events import Job, JobKind, Joined

MOST_AHEAD = 16
"""Jobs more than the one that is always at hand."""
AHEAD_S = 0.8
"""What these may take together [s]: nobody else can have them meanwhile."""
PAUSE_S = 0.2
"""The coordinator looks away from agents that are well provided so long [s]."""
_NEWEST_WEIGHT = 0.1
_PROVIDED = 1e6
"""More than any load of who has not enough at hand."""


@dataclass(slots=True)
class Pending:
    """A job that is not delivered yet.

    Attributes:
        job: which.
        holders: who is at it, one, or two if the first is late: when it was given it
            [s], and as the first, second, ... job of a slot of its.
        errors: how often somebody could not do it.
        avoid: who failed at it.
        killed: processes that it ended, and by what.
    """

    job: Job
    holders: dict[str, tuple[float, float]] = field(default_factory=dict)
    errors: int = 0
    avoid: tuple[str, ...] = ()
    killed: dict[str, str] = field(default_factory=dict)

    @property
    def since_s(self) -> float:
        """When whoever has it longest was given it [s]."""
        return min(since_s for since_s, _ in self.holders.values())


@dataclass(slots=True)
class AgentState:
    """One that does jobs.

    ``stamp`` names its only valid entry in its pool's heap; ``failures`` counts
    errors and losses since its last answer; ``job_s`` is how long a slot of its is at
    a job, typically [s], 0 before one is done.
    """

    joined: Joined
    held: dict[int, None] = field(default_factory=dict)
    job_s: float = 0.0
    failures: int = 0
    rests: bool = False
    stamp: int = 0

    def learn(self, duration_s: float) -> None:
        """Note how long a slot was at a job [s]."""
        known = self.job_s or duration_s
        self.job_s = known + _NEWEST_WEIGHT * (duration_s - known)

    @property
    def most_ahead(self) -> int:
        """How many jobs it can be given ahead: a slow one's would wait too long."""
        return min(MOST_AHEAD, int(AHEAD_S / self.job_s)) if self.job_s else 0


@dataclass(slots=True)
class Pool:
    """All agents of one kind and the jobs that wait for them.

    Attributes:
        at_hand: jobs beyond its slots that an agent has in any case.
        agents: by their names.
        free: (load, name, stamp) of each agent that does not rest, a heap; entries
            with an old stamp are dead and dropped when met.
        waiting: numbers of jobs, a heap.
    """

    at_hand: int = 1
    agents: dict[str, AgentState] = field(default_factory=dict)
    free: list[tuple[float, str, int]] = field(default_factory=list)
    waiting: list[int] = field(default_factory=list)

    def offer(self, name: str, stamp: int) -> None:
        """Note what an agent has to do now; its earlier entry dies."""
        agent = self.agents[name]
        agent.stamp = stamp
        if agent.rests:
            return
        if len(self.free) > 4 * len(self.agents) + 64:
            self.free = [entry for entry in self.free if self._is_live(entry)]
            heapify(self.free)
        heappush(self.free, (self._load(agent), name, stamp))

    def _load(self, agent: AgentState) -> float:
        """Return how much an agent has to do; 0 is nothing.

        Who has not what it must have at hand comes before all others, and these are
        as loaded as what they can be given ahead is used up.
        """
        spare = self._spare(agent)
        if spare < 0:
            return len(agent.held) / agent.joined.slots
        return _PROVIDED + (spare / agent.most_ahead if agent.most_ahead else inf)

    def best(self) -> str:
        """Return who has the least to do and may have more, empty if nobody may."""
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
        """Return how many jobs an agent has beyond what it must have at hand."""
        return len(agent.held) - agent.joined.slots - self.at_hand

    def _ahead(self, agent: AgentState) -> int:
        """Return how many jobs beyond that an agent may have: fewer near the end.

        Half of what waits is shared out, so that the last jobs go to whoever is done
        first.
        """
        return min(agent.most_ahead, len(self.waiting) // (2 * len(self.agents)))

    @property
    def leisure_s(self) -> float:
        """How long nobody will want for a job, as far as one can tell [s].

        Half of what the agent has to spare that is done first: jobs differ.
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
        """Return who has nothing to do and does not rest, by name."""
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
        """Return whether a job may go to an agent: others first, if there are any."""
        if name not in avoid:
            return True
        return sum(other in self.agents for other in avoid) == len(self.agents)

    def take(
        self,
        name: str,
        jobs: Mapping[int, Pending],
        avoided: Callable[[Pending], tuple[str, ...]],
    ) -> Pending | None:
        """Take the first waiting job that may go to an agent, if there is one.

        Args:
            name: of the agent.
            jobs: by their numbers.
            avoided: tells who shall not do a job if another one can.
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
        """Let a job wait no more."""
        self.waiting.remove(number)
        heapify(self.waiting)


REST_S = 0.05
LONGEST_REST_S = 3.2


class Backoff:
    """Who rests, and until when."""

    def __init__(self) -> None:
        """Nobody rests."""
        self._until: list[tuple[float, int, str]] = []
        self._order = count()

    @property
    def wake_s(self) -> float | None:
        """When the next rest is over [s]; None if nobody rests."""
        return self._until[0][0] if self._until else None

    def begin(self, agent: AgentState, now_s: float) -> None:
        """Let an agent rest; one rest at a time."""
        if agent.rests:
            return
        agent.rests = True
        rest_s = min(REST_S * 2**agent.failures, LONGEST_REST_S)
        agent.failures += 1
        heappush(self._until, (now_s + rest_s, next(self._order), agent.joined.agent))

    def over(self, now_s: float) -> Iterator[str]:
        """Yield the names of those whose rest is over; some may have left."""
        while self._until and self._until[0][0] <= now_s:
            yield heappop(self._until)[2]


class PairedJobs:
    """Who was given a job whose twin somebody else is to do."""

    def __init__(self) -> None:
        """Know of no pair."""
        self._doers: dict[int, dict[str, None]] = {}

    def __len__(self) -> int:
        """Return how many jobs are remembered."""
        return len(self._doers)

    def note(self, job: Job, agent: str) -> None:
        """Remember who is given a job."""
        if job.twin >= 0:
            self._doers.setdefault(job.number, {})[agent] = None

    def avoided(self, pending: Pending) -> tuple[str, ...]:
        """Return who shall not do a job if another one can."""
        doers = self._doers.get(pending.job.twin)
        if not doers:
            return pending.avoid
        return (*pending.avoid, *(each for each in doers if each not in pending.avoid))

    def forget(self, job: Job) -> None:
        """Forget a pair, both of which are done."""
        self._doers.pop(job.number, None)
        self._doers.pop(job.twin, None)


PATIENCE = 4.0
"""A job is late after so many times the typical duration of its kind."""
LEAST_S = 1.0
"""And never before [s]: a second copy costs more than waiting so long."""
LOOK_S = 0.25
"""Time between two looks for jobs that are late [s]."""


class Stragglers:
    """How long jobs of each kind take, from when they are given out [s]."""

    def __init__(self) -> None:
        """Know of no job yet."""
        self._typical_s: dict[JobKind, float] = {}
        self._next_look_s = 0.0

    def learn(self, kind: JobKind, duration_s: float) -> None:
        """Note how long a job took."""
        known = self._typical_s.get(kind, duration_s)
        self._typical_s[kind] = known + _NEWEST_WEIGHT * (duration_s - known)

    def is_time(self, now_s: float) -> bool:
        """Return whether to look for late jobs now; if so, not again for a while."""
        if now_s < self._next_look_s:
            return False
        self._next_look_s = now_s + LOOK_S
        return True

    def is_late(self, kind: JobKind, elapsed_s: float) -> bool:
        """Return whether a job that is out is late; never before one came back."""
        typical_s = self._typical_s.get(kind)
        if typical_s is None:
            return False
        return elapsed_s > max(LEAST_S, PATIENCE * typical_s)
