"""A run in this process, from opening its folder to its last row."""

import json
from collections import deque
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import ExitStack
from datetime import UTC, datetime
from importlib import metadata
from pathlib import Path

from coordinator.arena.arena import Arena
from coordinator.dispatch.events import KINDS, AgentKind, Deliver
from coordinator.dispatch.fleet import JobRouter
from coordinator.islands.events import JournalledEvent, Record
from coordinator.islands.island import Island
from coordinator.network.migration_service import MigrationService
from coordinator.run.archipelago import archipelago
from coordinator.run.cross_checks import NO_CHECKS, Checks
from coordinator.run.feed import Feed
from coordinator.run.group_link import GroupLink
from coordinator.run.loop import Loop
from coordinator.run.pose_recovery import PoseRecovery, pose_rows
from coordinator.run.run_context import RunContext
from coordinator.run.throttle import RealTimeThrottle
from coordinator.storage.folder import RunFolder
from coordinator.storage.journal import NAME as JOURNAL
from coordinator.storage.journal import Journal, is_begun
from coordinator.storage.recorder import Recorder
from coordinator.storage.snapshots import Snapshots
from schema.agent.log import warn_user
from schema.agent.machine import cpu_flags, platform_tag
from schema.agent.version import VERSION
from schema.errors import NetworkError, RunFolderError
from schema.experiment.file import experiment_from_text
from schema.experiment.identity import WHOLE
from schema.tables.columns import TABLES
from schema.tables.description import DETAILS, STATE, read_description
from schema.tables.files import has_rows
from schema.wire.status import IslandStatus, RunStatus

_LIBRARIES = ("mujoco-core", "eclipse-zenoh", "numpy", "pyarrow", "protobuf")
RATE_S = 60.0
"""Time over which a rate is averaged [s]; births of runs that take turns are bursts."""


class RateMeter:
    """Rate of a growing count."""

    def __init__(self) -> None:
        self._seen: deque[tuple[float, float]] = deque()

    def note(self, now_s: float, count: float) -> None:
        """Note the count at a time."""
        self._seen.append((now_s, count))
        while now_s - self._seen[0][0] > RATE_S:
            self._seen.popleft()

    @property
    def per_s(self) -> float:
        """Growth per second over the last seconds; 0 with fewer than two counts."""
        if not self._seen:
            return 0.0
        (first_s, first), (last_s, last) = self._seen[0], self._seen[-1]
        return (last - first) / (last_s - first_s) if last_s > first_s else 0.0


class RunSession:
    """A run in progress.

    Attributes:
        held: its folder, which this process has locked.
        loop: its islands and their connections.
        feed: collects its rows for viewers; None without a network.
        recovery: computes lost poses before the run continues; None: nothing is lost,
            so that the loop acts on the ends of jobs and advances.
        link: to the other groups of islands, if this run is one.
    """

    def __init__(
        self,
        held: RunFolder,
        fleet: JobRouter,
        *,
        fsync: bool = False,
        speed: float | None = None,
        parts: int | None = None,
        is_watched: bool = False,
        checks: Checks = NO_CHECKS,
        migration: Callable[[], MigrationService] | None = None,
    ) -> None:
        """Open the files of a run; ``start`` starts it.

        ``held``: the folder; closed with the run, or at once if this fails. ``fsync``:
        survive power loss, too. ``speed``: simulated seconds per second at most, of
        arenas; None: no limit. ``parts``: of an arena; None: as many as pay.
        ``migration``: connects to other groups of islands; None: no network.

        Raises:
            RunFolderError: a damaged journal, or a disk that fails.
            NetworkError: a group of islands without a network.
        """
        self.held = held
        details = held.details
        with ExitStack() as stack:
            stack.callback(held.close)
            if details.group.of > 1 and migration is None:
                raise NetworkError(f"{held.path}: a group of islands needs the network")
            check_journal(held.path)
            self._journal = stack.enter_context(
                Journal.open(held.path, epoch=held.epoch, fsync=fsync)
            )
            if self._journal.dropped:
                warn_user(
                    f"{held.path}: journal: dropped a cut record of "
                    f"{self._journal.dropped} bytes at its end"
                )
            self._recorder = Recorder(held.path, details, fsync=fsync, seal=held.seal)
            stack.callback(self._recorder.close)
            self.experiment = experiment_from_text(details.document, is_resumed=True)
            self.feed = Feed(held.name, held.epoch, details) if is_watched else None
            self.recovery: PoseRecovery | None = None
            self._events: Sequence[JournalledEvent] = ()
            self._fleet = fleet
            self._context = RunContext.of(
                held.name, held.epoch, self.experiment, details.origin
            )
            self.loop = Loop(
                archipelago(
                    self.experiment,
                    details.seed,
                    details.run,
                    details.founders,
                    details.group,
                ),
                context=self._context,
                fleet=fleet,
                log=self._journal,
                rows=self._recorder,
                snapshot_store=Snapshots(held.path),
                throttle=RealTimeThrottle(speed) if speed else None,
                parts=parts,
                checks=checks,
                confirm=held.confirm,
                watch=self.feed.unread.append if self.feed else None,
            )
            self.link = (
                GroupLink(details, self.loop, migration(), fleet.faults)
                if details.group.of > 1 and migration is not None
                else None
            )
            self._is_sealed = False
            self._births, self._simulated = RateMeter(), RateMeter()
            self._opened = stack.pop_all()

    def start(self) -> None:
        """Start, or resume where the journal ends, or first recover lost poses.

        Raises:
            RevolveError: the run cannot continue; see ``Loop.start``.
        """
        self._events = self._journal.replay()
        if self._recorder.poses.stored < pose_rows(self._events):
            self._recover()
        else:
            self.loop.start(self._replay())
        self.held.set_state("running")

    def _recover(self) -> None:
        self.recovery = PoseRecovery(
            self.held.details,
            self._context,
            self._events,
            fleet=self._fleet,
            recorder=self._recorder,
            snapshots=Snapshots(self.held.path),
        )
        _, total = self.recovery.progress
        warn_user(
            f"{self.held.path}: poses of arenas are lost; computing them again: "
            f"{total} advances"
        )
        self.recovery.start()

    def act(self, now_s: float, ends: Iterable[Deliver]) -> None:
        """Act on the ends of jobs, and on what other groups of islands have sent.

        A run that has lost poses computes them before its loop starts.

        Raises:
            RevolveError: the run cannot continue; see ``Loop.act``.
        """
        if self.recovery is not None:
            self._go_on_recovering(ends)
            return
        self.loop.act(now_s, ends)
        if self.link is not None:
            self.link.act(now_s)

    def _go_on_recovering(self, ends: Iterable[Deliver]) -> None:
        """Continue the recovery of lost poses; when it is done, start the loop."""
        assert self.recovery is not None
        self.held.confirm()
        self.recovery.act(ends)
        if self.recovery.is_done:
            self.recovery = None
            self.loop.start(self._replay())

    def _replay(self) -> Iterator[JournalledEvent]:
        """Yield and forget the journalled events; the feed condenses their rows."""
        events, self._events = list(reversed(self._events)), ()
        while events:
            yield events.pop()
            if self.feed is not None:
                self.feed.read()

    def do_chores(self) -> None:
        """Check that this process still owns the folder; flush rows to disk.

        Raises:
            RunFolderError: it does not, or the disk is full or failed.
        """
        self.held.confirm()
        self._recorder.flush()

    @property
    def is_done(self) -> bool:
        """It is finished, and no other group of islands needs its migrants."""
        return self._is_sealed and (self.link is None or self.link.is_done)

    def finish(self) -> bool:
        """Write the last row and the final form of all tables if all births are done.

        Return whether it has finished now.

        Raises:
            RunFolderError: another process owns the folder, or the disk failed.
        """
        if self._is_sealed or not self.loop.is_finished:
            return False
        self.held.confirm()
        self._recorder.write(_runs_row(self.held))
        self._recorder.finish()
        self.held.set_state("finished")
        self._is_sealed = True
        return True

    def stop(self) -> None:
        """Flush everything, so that the run can be resumed.

        Raises:
            RunFolderError: another process owns the folder, or the disk failed.
        """
        self.do_chores()
        if not self._is_sealed:
            self.held.set_state("stopped")

    def close(self) -> None:
        """Drop open requests; close the folder and all files."""
        self.loop.leave()
        self._opened.close()

    @property
    def wake_s(self) -> float | None:
        """When it has something to do by itself [s]; None: never."""
        timed = [self.loop.throttle, None if self.recovery else self.link]
        return min((each.wake_s for each in timed if each), default=None)

    @property
    def waiting(self) -> dict[int, str]:
        """Platforms of the arenas that wait for a worker; "" is any platform."""
        if self.recovery is not None:
            return self.recovery.waiting
        return self.loop.shard_requests.waiting

    @property
    def lacking(self) -> list[AgentKind]:
        """Kinds of agents that have joined but cannot do this run's jobs."""
        dispatch, client = self._fleet.dispatch, self.loop.client
        return [
            kind
            for kind in KINDS
            if dispatch.agents(kind) and not dispatch.fit(kind, client)
        ]

    def status(self, now_s: float) -> RunStatus:
        """Return the progress of the run."""
        islands = tuple(
            self._island_status(number, island)
            for number, island in sorted(self.loop.islands.items())
        )
        self._births.note(now_s, sum(island.births for island in islands))
        simulated_s = sum(island.simulated_s or 0.0 for island in islands)
        self._simulated.note(now_s, simulated_s)
        details = self.held.details
        state = "waiting" if self.lacking else "running"
        if self.loop.is_finished:
            state = "finished"
        return RunStatus(
            folder=str(self.held.path.resolve()),
            name=details.name,
            run=details.run,
            state=state,
            births_per_s=self._births.per_s,
            islands=islands,
            simulated_per_s=self._simulated.per_s,
            group=details.group,
            silent_groups=self.link.exchange.silent if self.link else (),
            unserved_groups=self.link.exchange.unserved if self.link else (),
        )

    def _island_status(self, number: int, island: Island | Arena) -> IslandStatus:
        arena = island if isinstance(island, Arena) else None
        parts, repeats = self.loop.shard_requests.divided(number) if arena else ((), 0)
        return IslandStatus(
            births=island.births,
            wanted=island.births if island.is_finished else island.experiment.births,
            best=max((one.fitness for one in island.judged), default=None),
            alive=len(island.population),
            simulated_s=arena.clock.seconds(arena.step) if arena else None,
            is_paused=bool(arena and arena.is_paused),
            parts=parts,
            repeats=repeats,
            awaited=self._awaited(island),
        )

    def _awaited(self, island: Island | Arena) -> tuple[int, ...]:
        """Return the islands of other groups whose migrants an island waits for."""
        if self.link is None or island.epochs is None or not island.epochs.is_waiting:
            return ()
        missing = island.epochs.missing
        return tuple(each for each in missing if each not in self.loop.islands)


def check_journal(folder: Path) -> None:
    """Raise if a run has lost its journal; call it before any file is changed.

    Raises:
        RunFolderError: there is no journal, and there was one.
    """
    is_old = (folder / STATE).exists() or any(has_rows(folder, name) for name in TABLES)
    if is_old and not is_begun(folder):
        known = read_description(folder)
        if known.archipelago and known.group == WHOLE:
            raise RunFolderError(f"{folder}: was joined of groups: resume these")
        raise RunFolderError(
            f"{folder / JOURNAL}: is lost: put a sound copy of it in its place, or "
            "begin anew in another folder"
        )


def _runs_row(held: RunFolder) -> Record:
    began = (held.path / DETAILS).stat().st_mtime
    versions = {name: metadata.version(name) for name in _LIBRARIES}
    versions["revolve-islands"] = VERSION
    own = held.details
    row = {
        **{name: getattr(own, name) for name in ("name", "run", "seed", "document")},
        "state": "finished",
        "versions": json.dumps(versions),
        "platform": platform_tag(),
        "cpu_flags": " ".join(sorted(cpu_flags(Path("/proc/cpuinfo")))),
        "start": datetime.fromtimestamp(began, UTC),
        "end": datetime.now(UTC),
    }
    return Record("runs", row)
