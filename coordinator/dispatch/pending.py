"""Jobs that are not delivered yet."""

from dataclasses import dataclass, field

from coordinator.dispatch.events import Job


@dataclass(slots=True)
class Pending:
    """A job that is not delivered yet.

    Attributes:
        job: the job.
        holders: agents that have it, several if the first is late, in order: time of
            assignment [s], and its place in the queue of a slot (1.0 is first).
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
        return next(iter(self.holders.values()))[0]


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
