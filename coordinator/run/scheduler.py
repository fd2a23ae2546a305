"""Runs side by side through one fleet: as many at once as keep it busy.

A run that needs the outcome of one birth before the next has a single question open;
many such runs together fill all workers. So another run is begun whenever fewer
questions are open than twice the jobs that the workers may have: one half is with
them, the other on its way to or from the analyzers and this process.
"""

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial

from msgspec.structs import replace

from coordinator.dispatch.events import Client
from coordinator.dispatch.fleet import End, Fleet
from coordinator.run.session import RateMeter, RunSession
from coordinator.storage.folder import RunDetails, RunFolder
from schema.errors import RevolveError
from schema.wire.status import RunStatus, Status

SLACK = 2
"""Open questions per job that the workers may have at a time."""


@dataclass(frozen=True, slots=True)
class Planned:
    """A run to be done.

    Attributes:
        details: what is to be run.
        status: how far it is before it is begun.
        take: takes its folder.
    """

    details: RunDetails
    status: RunStatus
    take: Callable[[], RunFolder]


class RunScheduler:
    """All runs of this process.

    Attributes:
        fleet: who does the work.
        active: runs on their way, in the order in which they were begun.
        failed: runs that could not go on, and why.
    """

    def __init__(
        self,
        planned: Sequence[Planned],
        fleet: Fleet,
        *,
        open_run: Callable[[RunFolder, bool], RunSession],
        most: int,
        conclude: Callable[[RunSession], object],
        report: Callable[[RunDetails, RevolveError], None],
    ) -> None:
        """Begin nothing yet.

        Args:
            planned: all runs in order, those that are finished, too.
            fleet: who does the work.
            open_run: opens the run of a folder; told whether it may be watched.
            most: runs that there may be at once.
            conclude: told of each run that is finished.
            report: told of each run that cannot go on, and why.
        """
        self.active: list[RunSession] = []
        self.failed: list[tuple[RunDetails, RevolveError]] = []
        self.fleet = fleet
        self._open_run = open_run
        self._most = most
        self._conclude = conclude
        self._report = report
        self._known = [one.status for one in planned]
        self._planned = deque(
            (place, one)
            for place, one in enumerate(planned)
            if one.status.state != "finished"
        )
        self._places: dict[RunSession, int] = {}
        self._run_of: dict[Client, RunSession] = {}
        self._rate = RateMeter()
        self._is_stopped = False

    @property
    def is_finished(self) -> bool:
        """Nothing is left to do."""
        return not (self.active or self._planned or self._is_stopped)

    @property
    def watched(self) -> RunSession | None:
        """The run that those who watch are shown."""
        return next((run for run in self.active if run.feed is not None), None)

    def turn(self, timeout_s: float, clock: Callable[[], float]) -> None:
        """Begin runs, listen, and let every run with news act on it.

        Args:
            timeout_s: how long to wait when nothing is there [s].
            clock: tells the time; it only goes forward [s].
        """
        while self._planned and self._has_room():
            self._begin(*self._planned.popleft())
        now_s = clock()
        acting: dict[RunSession, list[End]] = {}
        for run in self.active:
            if (throttle := run.loop.throttle) is not None:
                acting[run] = []
                timeout_s = min(timeout_s, max(0.0, throttle.wake_s - now_s))
        for client, ends in self.fleet.listen(timeout_s, now_s).items():
            if client in self._run_of:
                acting[self._run_of[client]] = ends
        now_s = clock()
        for run, ends in acting.items():
            self.guard(run, partial(run.loop.act, now_s, ends))

    def _has_room(self) -> bool:
        if not self.active:
            return True
        is_full = self.fleet.open >= SLACK * self.fleet.credits
        return not is_full and len(self.active) < self._most

    def _begin(self, place: int, planned: Planned) -> None:
        try:
            run = self._open_run(planned.take(), self.watched is None)
        except RevolveError as error:
            self._fail(place, planned.details, error)
            return
        self.active.append(run)
        self._places[run] = place
        self._run_of[run.loop.client] = run
        self.guard(run, run.start)

    def guard(self, run: RunSession, act: Callable[[], None]) -> None:
        """Let a run act; what goes wrong is its own affair."""
        try:
            act()
            if run.loop.is_finished:
                run.finish()
                self._conclude(run)
        except RevolveError as error:
            self._fail(self._places[run], run.held.details, _cause(run, error))
            self._dismiss(run)
            return
        if run.loop.is_finished:
            self._known[self._places[run]] = replace(run.status(0.0), births_per_s=0.0)
            self._dismiss(run)

    def _fail(self, place: int, details: RunDetails, error: RevolveError) -> None:
        self.failed.append((details, error))
        self._report(details, error)
        self._known[place] = replace(self._known[place], state="failed")

    def _dismiss(self, run: RunSession) -> None:
        run.close()
        self.active.remove(run)
        del self._places[run]
        del self._run_of[run.loop.client]

    def do_chores(self, now_s: float) -> None:
        """Bring all rows to disk; find out which runs went on without us.

        Args:
            now_s: the time, of any clock that only goes forward [s].
        """
        # So that whoever asks hears a pace, though nobody here looks.
        self.status(now_s)
        for run in list(self.active):
            self.guard(run, run.do_chores)

    def stop(self) -> None:
        """Leave all runs as they are, to go on another day."""
        self._is_stopped = not self.is_finished
        for run in list(self.active):
            self.guard(run, run.stop)
            if run in self._places:
                self._dismiss(run)

    def close(self) -> None:
        """Let go of whatever is still in hand."""
        for run in list(self.active):
            self._dismiss(run)

    def status(self, now_s: float) -> Status:
        """Return how far all runs are.

        Args:
            now_s: the time, of any clock that only goes forward [s].
        """
        runs = list(self._known)
        born = sum(run.births for run in runs)
        for run in self.active:
            place = self._places[run]
            new = run.status(now_s)
            born += new.births - runs[place].births
            runs[place] = new
        self._rate.note(now_s, born)
        return Status(
            runs=tuple(runs),
            workers=self.fleet.dispatch.agents("worker"),
            analyzers=self.fleet.dispatch.agents("analyzer"),
            births_per_s=self._rate.per_s,
        )


def _cause(run: RunSession, error: RevolveError) -> RevolveError:
    """Return why a run cannot go on.

    Where another coordinator took it over while this one slept, whatever went wrong
    here is of no interest.
    """
    try:
        run.held.confirm()
    except RevolveError as taken_over:
        return taken_over
    return error
