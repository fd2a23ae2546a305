"""All agents of one kind, who has the least to do, and the jobs that wait for them."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from heapq import heapify, heappop, heappush

from coordinator.events import Job, Joined


@dataclass(slots=True)
class Pending:
    """A job that is not delivered yet.

    Attributes:
        job: which.
        holders: who is at it: one, or two if the first is late.
        since_s: when the first of them was given it [s].
        errors: how often somebody could not do it.
        avoid: who failed at it.
        killed: processes that it ended, and by what.
    """

    job: Job
    holders: list[str] = field(default_factory=list)
    since_s: float = 0.0
    errors: int = 0
    avoid: tuple[str, ...] = ()
    killed: dict[str, str] = field(default_factory=dict)


@dataclass(slots=True)
class AgentState:
    """One that does jobs.

    ``stamp`` names its only valid entry in its pool's heap; ``failures`` counts
    errors and losses since its last answer.
    """

    joined: Joined
    held: dict[int, None] = field(default_factory=dict)
    failures: int = 0
    rests: bool = False
    stamp: int = 0


@dataclass(slots=True)
class Pool:
    """All agents of one kind and the jobs that wait for them.

    ``free`` holds (load, name, stamp) of each agent with credit; entries with an
    old stamp are dead and dropped when met.
    """

    agents: dict[str, AgentState] = field(default_factory=dict)
    free: list[tuple[float, str, int]] = field(default_factory=list)
    waiting: list[int] = field(default_factory=list)

    def offer(self, name: str, stamp: int) -> None:
        """Note what an agent can take now; its earlier entry dies."""
        agent = self.agents[name]
        agent.stamp = stamp
        if agent.rests or len(agent.held) > agent.joined.slots:
            return
        if len(self.free) > 4 * len(self.agents) + 64:
            self.free = [entry for entry in self.free if self._is_live(entry)]
            heapify(self.free)
        heappush(self.free, (len(agent.held) / agent.joined.slots, name, stamp))

    def best(self) -> str:
        """Return who has the least to do and credit left, empty if nobody has."""
        while self.free:
            if self._is_live(self.free[0]):
                return self.free[0][1]
            heappop(self.free)
        return ""

    def idle(self) -> list[str]:
        """Return who has nothing to do and does not rest, by name."""
        if not self.best() or self.free[0][0] > 0.0:
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
