"""Jobs that come in pairs, the same question to two agents: who did which. Pure."""

from coordinator.dispatch_events import Job
from coordinator.pool import Pending


class Twins:
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
