"""Homes of arena shards: which worker keeps the state of which shard.

One worker holds the state of a shard and makes its advances. If that worker is gone,
fails, lacks the state or is silent, the advance goes, with all that is needed to
rebuild the state, to another worker of an equal platform: one that keeps more states
than it has, with the lowest load; ties break on the name. A worker that is unfit for
the shard's client never gets it. A shard without a worker waits. If the user allows a
drift, one of another platform gets it after a while. A worker that joins takes over
shards of those that hold more.
"""

from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass

from coordinator.dispatch.events import NO_CLIENT, Client, Crowded
from coordinator.dispatch.pool import Deadlines, Pending, Pool

DRIFT_S = 30.0
"""Time that a shard waits for its own platform before it may drift [s]."""
LEAST_S = 2.0
"""An advance is never late before this time [s]: to rebuild a state is expensive."""
_MOST_DOUBLINGS = 16


@dataclass(slots=True)
class Home:
    """A shard, the worker that keeps it, and its present advance.

    Attributes:
        platform: of the last advance; empty before the first.
        may_drift: it may move to another platform, if shards may.
        holder: the worker that is bound to it; empty if none is.
        successor: the worker that takes over after the present advance; empty if none
            does.
        has_state: the holder has its state.
        advance: the advance that is requested; None if none is.
        is_whole: its request includes what is needed to rebuild the state.
        misses: how often it moved to a worker that had it before.
        drifts_at_s: when it may drift to another platform [s].
    """

    client: Client = NO_CLIENT
    platform: str = ""
    may_drift: bool = True
    holder: str = ""
    successor: str = ""
    has_state: bool = False
    advance: Pending | None = None
    is_whole: bool = False
    misses: int = 0
    drifts_at_s: float | None = None

    def unbind(self) -> None:
        """Take it from its worker."""
        self.holder, self.successor = self.successor, ""
        self.has_state = False

    @property
    def is_waiting(self) -> bool:
        """Its advance is requested, and no worker has it."""
        return self.advance is not None and not self.advance.holders


class Homes:
    """The shards of all runs, and the choice of their workers.

    Attributes:
        deadlines: of advances, by shard.
        rebuilt: number of assigned advances that start from a rebuilt state.
    """

    def __init__(self, workers: Pool, *, allows_drift: bool) -> None:
        """Initialise without shards.

        ``allows_drift``: a shard may move to another platform if its own is gone.
        """
        self.now_s = 0.0
        self.shards: dict[int, Home] = {}
        self.deadlines = Deadlines(LEAST_S)
        self.rebuilt = 0
        self._workers = workers
        self._allows_drift = allows_drift
        self._is_crowded = False

    @property
    def wake_s(self) -> float | None:
        """Time at which some shard may drift [s]; None if none waits for that."""
        wakes = (home.drifts_at_s for home in self.shards.values())
        # A shard that may drift by now waits for a worker, not for a time.
        return min(
            (wake for wake in wakes if wake is not None and wake > self.now_s),
            default=None,
        )

    @property
    def waiting(self) -> dict[int, str]:
        """Platforms of the shards that wait for a worker; "" is any platform."""
        return {
            shard: home.platform
            for shard, home in sorted(self.shards.items())
            if home.advance is not None and not self.fit(home)
        }

    @property
    def unassigned(self) -> int:
        """Number of advances that are requested and that no worker has."""
        return sum(home.is_waiting for home in self.shards.values())

    @property
    def assigned(self) -> int:
        """Number of advances that workers have."""
        wanted = sum(home.advance is not None for home in self.shards.values())
        return wanted - self.unassigned

    @property
    def are_busy(self) -> bool:
        """Some advance is requested."""
        return any(home.advance is not None for home in self.shards.values())

    def holder(self, shard: int) -> str:
        """Return the name of the worker that holds a shard; empty if none does."""
        home = self.shards.get(shard)
        return home.holder if home else ""

    def of(self, shard: int) -> Home:
        """Return the home of a shard, which may be new."""
        return self.shards.setdefault(shard, Home())

    def limit_s(self, shard: int) -> float:
        """Return how long a shard's advance may take on its present worker [s].

        If that worker had it before, the limit is twice as long, so that an advance
        that takes long everywhere ends.
        """
        home = self.shards[shard]
        assert home.advance is not None
        limit_s = self.deadlines.limit_s(shard, home.advance.job.simulated_s)
        return limit_s * 2.0 ** min(home.misses, _MOST_DOUBLINGS)

    def wait(self) -> None:
        """Set the times from which shards that wait may drift.

        A shard has none while a worker of its platform is connected.
        """
        for home in self.shards.values():
            if not (self._allows_drift and home.may_drift):
                continue
            if home.advance is None or not home.platform or self._equal(home):
                home.drifts_at_s = None
            elif home.drifts_at_s is None:
                home.drifts_at_s = self.now_s + DRIFT_S

    def settle(self) -> Iterator[int | Crowded]:
        """Bind the shards that wait; yield those whose advances are to be sent.

        The user is told, once, if the workers cannot keep all shards.
        """
        for shard, home in sorted(self.shards.items()):
            if not home.is_waiting:
                continue
            if not home.holder:
                home.holder = self._choice(home)
                yield from self._count()
            if home.holder:
                yield shard

    def _count(self) -> Iterator[Crowded]:
        kept = sum(a.joined.shards for a in self._workers.agents.values())
        bound = sum(bool(home.holder) for home in self.shards.values())
        if bound <= kept:
            self._is_crowded = False
        elif not self._is_crowded:
            self._is_crowded = True
            yield Crowded(bound, kept)

    def excess(self, newcomer: str) -> int | None:
        """Return a shard of a worker that holds more than a newcomer; None if none.

        Those without a state are cheap, so they go first.
        """
        agents, bound = self._workers.agents, self._bound()
        joined = agents[newcomer].joined
        places = {
            shard: home.successor or home.holder
            for shard, home in self.shards.items()
            if home.holder and newcomer in self.fit(home)
        }
        # What its present worker would keep.
        kept, _, shard = max(
            (
                (
                    (bound[name] - 1) / agents[name].joined.cores,
                    not self.shards[shard].has_state,
                    shard,
                )
                for shard, name in places.items()
            ),
            default=(0.0, False, 0),
        )
        share = (bound[newcomer] + 1) / joined.cores
        return None if bound[newcomer] >= joined.shards or kept < share else shard

    def with_room(self, home: Home) -> str:
        """Return the best worker with room for a shard; empty if there is none."""
        crowding = self._crowding()
        free = (n for n in self.fit(home) if crowding(n)[:2] == (False, False))
        return min(free, key=crowding, default="")

    def fit(self, home: Home) -> list[str]:
        """Return the workers that may hold a shard, by name."""
        fit = self._equal(home)
        if fit or home.drifts_at_s is None or self.now_s < home.drifts_at_s:
            return fit
        return sorted(self._workers.fit(home.client))

    def _equal(self, home: Home) -> list[str]:
        agents = self._workers.agents
        return [
            name
            for name in sorted(self._workers.fit(home.client))
            if home.platform in ("", agents[name].joined.platform)
        ]

    def _choice(self, home: Home) -> str:
        """Return the best worker for a shard; "" if all are backing off.

        Workers that failed at the advance come last.
        """
        fit = self.fit(home)
        avoid = home.advance.avoid if home.advance else ()
        fresh = [name for name in fit if name not in avoid] or fit
        agents = self._workers.agents
        ready = (name for name in fresh if not agents[name].is_backing_off)
        return min(ready, key=self._crowding(), default="")

    def _bound(self) -> Counter[str]:
        """Return how many shards each worker holds or takes over."""
        return Counter(home.successor or home.holder for home in self.shards.values())

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
