"""Progress of runs, as a coordinator reports it or a run folder shows it."""

from collections.abc import Iterable, Sequence
from itertools import count
from typing import Annotated, Literal

from msgspec import Meta, field

from schema.experiment.identity import WHOLE, Group
from schema.experiment.section import Count
from schema.limits import MOST_SHOWN, Finite
from schema.robot.ids import IslandNumber
from schema.wire.codec import Message


class PartStatus(Message, frozen=True):
    """A part of an arena that several workers advance.

    Attributes:
        worker: that holds it.
        robots: number of its robots.
        cost: its share of the cost of all parts, as far as that is known.
        came: number of robots that it took from others since the arena was divided.
    """

    worker: str
    robots: Count
    cost: Finite
    came: Count


class IslandStatus(Message, frozen=True):
    """Progress of an island.

    Attributes:
        births: number of births so far.
        wanted: number of births at the end.
        best: greatest fitness of the living; None if none has been evaluated.
        alive: number of living robots.
        simulated_s: simulated time of an arena [s]; None off-line.
        is_paused: an operator has paused the arena.
        parts: of an arena that several workers advance.
        repeats: number of exchanges between these after which robots were advanced
            again, because those of two parts came near each other.
        awaited: islands of other groups whose migrants it waits for.
    """

    births: Count
    wanted: Count
    best: Finite | None
    alive: Count
    simulated_s: Finite | None = None
    is_paused: bool = False
    parts: tuple[PartStatus, ...] = ()
    repeats: Count = 0
    awaited: tuple[IslandNumber, ...] = ()


class RunStatus(Message, frozen=True):
    """Progress of a run.

    Attributes:
        folder: path of the run folder.
        name: of the experiment.
        run: number of the repeat.
        state: "waiting", "running", "stopped", "finished", "failed" or "damaged".
        births_per_s: recent rate [1/s].
        islands: of its group, by island number; empty if nothing is known about them.
        simulated_per_s: recent simulated seconds per second, of all arenas together.
        group: of islands, which the run has.
        silent_groups: those that do not answer.
        unserved_groups: those that may need migrants of this one.
    """

    folder: str
    name: str
    run: Count
    state: str
    births_per_s: Finite = 0.0
    islands: tuple[IslandStatus, ...] = ()
    simulated_per_s: Finite = 0.0
    group: Group = WHOLE
    silent_groups: tuple[Count, ...] = ()
    unserved_groups: tuple[Count, ...] = ()

    @property
    def numbered(self) -> Iterable[tuple[int, IslandStatus]]:
        """Its islands with their numbers."""
        return zip(count(self.group.number, self.group.of), self.islands, strict=False)

    @property
    def births(self) -> int:
        """Number of births on all islands so far."""
        return sum(island.births for island in self.islands)

    @property
    def wanted(self) -> int:
        """Number of births on all islands at the end."""
        return sum(island.wanted for island in self.islands)

    @property
    def left_s(self) -> float | None:
        """Estimated time to the end at the present rate [s]; None if unknown."""
        return _left_s((self,), self.births_per_s)


class PeerFault(Message, frozen=True):
    """How often a peer sent something that the coordinator did not use.

    Attributes:
        kind: such as "malformed", "refused" or "late".
        peer: name of the agent, or what several peers are counted as.
        count: number of such messages.
    """

    kind: Annotated[str, Meta(max_length=MOST_SHOWN)]
    peer: Annotated[str, Meta(max_length=MOST_SHOWN)]
    count: Count


class Queue(Message, frozen=True):
    """Requests of one kind that are not done.

    Attributes:
        kind: "worker" or "analyzer", jobs for such agents; or "arena", advances of
            arenas, which workers do.
        waiting: number of those that no agent has, or silent ones only.
        assigned: number of those that agents have, copies of late jobs included.
    """

    kind: Literal["worker", "analyzer", "arena"]
    waiting: Count
    assigned: Count


class Status(Message, frozen=True):
    """Progress of all runs of a coordinator.

    Attributes:
        runs: in the order in which they start.
        workers, analyzers: number of connected agents.
        births_per_s: recent rate of all runs [1/s].
        faults: what peers sent and nothing used, by kind and peer.
        queues: by kind; empty if no coordinator is running.
        silent: jobs and advances of each agent that neither answers nor reports
            progress, by its name.
    """

    runs: tuple[RunStatus, ...]
    workers: Count
    analyzers: Count
    births_per_s: Finite
    faults: tuple[PeerFault, ...] = ()
    queues: tuple[Queue, ...] = ()
    silent: dict[str, Count] = field(default_factory=dict)

    @property
    def births(self) -> int:
        """Number of births in all runs so far."""
        return sum(run.births for run in self.runs)

    @property
    def wanted(self) -> int:
        """Number of births in all runs at the end."""
        return sum(run.wanted for run in self.runs)

    @property
    def left_s(self) -> float | None:
        """Estimated time to the end at the present rate [s]; None if unknown."""
        return _left_s(self.runs, self.births_per_s)


def joined(statuses: Sequence[Status]) -> Status:
    """Return the progress of the coordinators of one fleet, whose agents they share."""
    return Status(
        runs=tuple(run for each in statuses for run in each.runs),
        workers=max(each.workers for each in statuses),
        analyzers=max(each.analyzers for each in statuses),
        births_per_s=sum(each.births_per_s for each in statuses),
        faults=tuple(fault for each in statuses for fault in each.faults),
        queues=tuple(queue for each in statuses for queue in each.queues),
        silent={k: v for each in statuses for k, v in each.silent.items()},
    )


def _left_s(runs: Iterable[RunStatus], births_per_s: float) -> float | None:
    """Return the time to the end of runs at a rate [s]; None if it is unknown.

    It is unknown if the rate is 0, or while an arena is paused. It is no less than that
    of any single run at its own rate.
    """
    open_runs = [run for run in runs if run.state in ("waiting", "running")]
    lefts = [run.wanted - run.births for run in open_runs]
    if not sum(lefts):
        return 0.0
    are_paused = (island.is_paused for run in open_runs for island in run.islands)
    if not births_per_s or any(are_paused):
        return None
    own = zip(lefts, (run.births_per_s for run in open_runs), strict=True)
    return max(sum(lefts) / births_per_s, *(n / rate for n, rate in own if rate), 0.0)
