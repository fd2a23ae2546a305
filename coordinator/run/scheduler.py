"""Scheduler: starts as many runs at once as keep the fleet busy.

A run that needs the result of one birth before the next has a single open request;
many such runs together keep all workers busy. Another run is therefore started
whenever fewer requests are open than twice the jobs that the workers may hold: one half
is with them, the other on its way to or from the analyzers and this process.
"""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import KW_ONLY, dataclass
from functools import partial

from msgspec.structs import replace

from coordinator.dispatch.events import KINDS, AgentKind, Client, Deliver
from coordinator.dispatch.fleet import JobRouter
from coordinator.run.session import RateMeter, RunSession
from coordinator.storage.folder import RunFolder
from schema.errors import RevolveError
from schema.wire.status import Queue, RunStatus, Status

SLACK = 2
"""Open requests per job that the workers may hold at a time."""


@dataclass(frozen=True, slots=True)
class Planned:
    """A run that is planned.

    Attributes:
        status: its name, and its progress before it is started.
        take: locks its folder.
    """

    status: RunStatus
    take: Callable[[], RunFolder]

    @property
    def is_finished(self) -> bool:
        """It needs no start."""
        return self.status.state == "finished"


@dataclass(eq=False)
class RunScheduler:
    """All runs of this process; ``turn`` starts them.

    Attributes:
        planned: all runs in order, finished ones included.
        open_run: opens the run of a folder; the flag says whether it is watched.
        most: number of runs that there may be at once.
        conclude: called with each run that is finished.
        report: called with each run that cannot continue, and its error.
        failed: runs that could not continue, with their errors.
    """

    planned: Sequence[Planned]
    fleet: JobRouter
    _: KW_ONLY
    open_run: Callable[[RunFolder, bool], RunSession]
    most: int
    conclude: Callable[[RunSession], object]
    report: Callable[[RunStatus, RevolveError], None]

    def __post_init__(self) -> None:
        """Plan the runs."""
        self.failed: list[tuple[RunStatus, RevolveError]] = []
        self._known = [one.status for one in self.planned]
        places = enumerate(self.planned)
        self._waiting = deque(each for each in places if not each[1].is_finished)
        self._places: dict[RunSession, int] = {}
        self._run_of: dict[Client, RunSession] = {}
        self._rate = RateMeter()
        self._is_stopped = False

    @property
    def active(self) -> list[RunSession]:
        """Runs in progress, in the order of their start."""
        return list(self._places)

    @property
    def is_finished(self) -> bool:
        """All runs have ended."""
        return not (self._places or self._waiting or self._is_stopped)

    @property
    def watched(self) -> RunSession | None:
        """The run that viewers are shown."""
        return next((run for run in self._places if run.feed is not None), None)

    def turn(self, timeout_s: float, clock: Callable[[], float]) -> None:
        """Start runs, receive answers, and let the runs act on them."""
        while self._waiting and self._has_room():
            self._begin(*self._waiting.popleft())
        now_s = clock()
        acting: dict[RunSession, list[Deliver]] = {}
        for run in self._places:
            if (wake_s := run.wake_s) is not None:
                acting[run] = []
                timeout_s = min(timeout_s, max(0.0, wake_s - now_s))
        for client, ends in self.fleet.listen(timeout_s, now_s).items():
            if client in self._run_of:
                acting[self._run_of[client]] = ends
        self._check_fenced()
        now_s = clock()
        for run, ends in acting.items():
            if run in self._places:
                self.guard(run, partial(run.act, now_s, ends))

    def _check_fenced(self) -> None:
        """Stop the runs that another coordinator took over, as agents say.

        Only the run's own folder decides: any process can tell agents that it is a
        later coordinator.
        """
        for fenced in self.fleet.fenced():
            run = self._run_of.get(fenced.client)
            if run is None:
                continue
            self.guard(run, run.held.confirm)
            if run in self._places:
                self.fleet.faults.note("fenced", fenced.agent, fenced.reason)

    def _has_room(self) -> bool:
        if not self._places:
            return True
        is_full = self.fleet.dispatch.pending >= SLACK * self.fleet.dispatch.credits
        return not is_full and len(self._places) < self.most

    def _begin(self, place: int, planned: Planned) -> None:
        try:
            run = self.open_run(planned.take(), self.watched is None)
        except RevolveError as error:
            self._fail(place, error)
            return
        self._places[run] = place
        self._run_of[run.loop.client] = run
        self.guard(run, run.start)

    def guard(self, run: RunSession, act: Callable[[], None]) -> None:
        """Let a run act; an error ends this run only."""
        try:
            act()
            if run.finish():
                self.conclude(run)
        except RevolveError as error:
            self._fail(self._places[run], _cause(run, error))
            self._dismiss(run)
            return
        if run.is_done:
            self._known[self._places[run]] = replace(run.status(0.0), births_per_s=0.0)
            self._dismiss(run)

    def _fail(self, place: int, error: RevolveError) -> None:
        status = self._known[place] = replace(self._known[place], state="failed")
        self.failed.append((status, error))
        self.report(status, error)

    def _dismiss(self, run: RunSession) -> None:
        run.close()
        del self._places[run]
        del self._run_of[run.loop.client]

    def do_chores(self, now_s: float) -> None:
        """Flush all rows to disk; find runs that another coordinator took over."""
        # Operators are told a rate even if no progress is shown here.
        self.status(now_s)
        for run in self.active:
            self.guard(run, run.do_chores)

    def stop(self) -> None:
        """Stop all runs so that they can be resumed."""
        self._is_stopped = not self.is_finished
        for run in self.active:
            self.guard(run, run.stop)
            if run in self._places:
                self._dismiss(run)

    def close(self) -> None:
        """Close the runs that are still open."""
        for run in self.active:
            self._dismiss(run)

    def status(self, now_s: float) -> Status:
        """Return the progress of all runs."""
        runs = list(self._known)
        born = sum(run.births for run in runs)
        for run, place in self._places.items():
            new = run.status(now_s)
            born += new.births - runs[place].births
            runs[place] = new
        self._rate.note(now_s, born)
        return Status(
            runs=tuple(runs),
            workers=self._useful("worker"),
            analyzers=self._useful("analyzer"),
            births_per_s=self._rate.per_s,
            faults=self.fleet.faults.counts,
            queues=_queues(self.fleet),
            silent=self.fleet.dispatch.silent(),
        )

    def _useful(self, kind: AgentKind) -> int:
        """Return how many agents of a kind can do the jobs of some run in progress."""
        if not self._run_of:
            return self.fleet.dispatch.agents(kind)
        fit = (self.fleet.dispatch.fit(kind, client) for client in self._run_of)
        return len(set().union(*fit))


def _queues(fleet: JobRouter) -> tuple[Queue, ...]:
    its, homes = fleet.dispatch, fleet.dispatch.homes
    jobs = (Queue(kind, its.waiting(kind), its.assigned(kind)) for kind in KINDS)
    return (*jobs, Queue("arena", homes.unassigned, homes.assigned))


def _cause(run: RunSession, error: RevolveError) -> RevolveError:
    """Return why a run cannot continue.

    If another coordinator took it over while this process was suspended, that is the
    cause.
    """
    try:
        run.held.confirm()
    except RevolveError as taken_over:
        return taken_over
    return error
