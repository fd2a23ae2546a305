"""What this process shows while it lives: bars of runs and islands on the terminal."""

import math
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    TaskID,
    TextColumn,
)

from coordinator.cli.format import about_arenas, best_of, duration
from coordinator.run.scheduler import RunScheduler
from coordinator.run.session import SPAN_S
from schema.wire.status import IslandStatus, RunStatus, Status

MOST_BARS = 16
"""Bars of single runs or islands: more would not fit on a screen."""


class Display:
    """Progress bars; a line every so often where there is no terminal."""

    def __init__(self, scheduler: RunScheduler, *, quiet: bool) -> None:
        """Show all runs that somebody conducts."""
        self._scheduler = scheduler
        self._console = Console(stderr=True)
        self._quiet = quiet
        self._progress = Progress(
            TextColumn("{task.description}"),
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("births {task.fields[about]}"),
            console=self._console,
            disable=quiet or not self._console.is_terminal,
        )
        self._tasks: dict[str, TaskID] = {}
        self._next_line_s = -math.inf
        self._waits_since: float | None = None
        self._said_waiting: dict[str, str] = {}

    def __enter__(self) -> Self:
        """Start drawing."""
        self._progress.start()
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Leave the last state on the screen."""
        self._progress.stop()

    def update(self, now_s: float) -> None:
        """Show the present state.

        Args:
            now_s: the time, of any clock that only goes forward [s].
        """
        if self._quiet:
            return
        status = self._scheduler.status(now_s)
        if self._console.is_terminal:
            self._draw(status)
        elif now_s >= self._next_line_s:
            self._next_line_s = now_s + SPAN_S
            self._console.print(_line(status), soft_wrap=True)
        self._say_who_is_missing(status, now_s)

    def _draw(self, status: Status) -> None:
        rows: dict[str, tuple[IslandStatus | RunStatus | Status, str]] = {}
        about = f"{_pace(status)}, {_process_pool(status)}"
        if len(status.runs) > 1:
            done = sum(run.state == "finished" for run in status.runs)
            name = f"{done} of {len(status.runs)} runs"
            rows[""] = (status, about)
            shown = [run for run in status.runs if run.state == "running"]
            for run in shown[:MOST_BARS]:
                what = f"{best_of(run)}{about_arenas(run)}"
                rows[f"{run.name}-{run.run}"] = (run, what)
        else:
            (run,) = status.runs
            name = run.name
            what = f"{about}, {best_of(run)}{about_arenas(run)}"
            rows[""] = (run, what)
            islands = run.islands if 1 < len(run.islands) <= MOST_BARS else ()
            for number, island in enumerate(islands):
                rows[f"  island {number}"] = (island, best_of(island))
        for gone in [key for key in self._tasks if key not in rows]:
            self._progress.remove_task(self._tasks.pop(gone))
        for key, (counted, what) in rows.items():
            if key not in self._tasks:
                self._tasks[key] = self._progress.add_task(key, about="")
            self._progress.update(
                self._tasks[key],
                description=key or name,
                completed=counted.births,
                total=counted.wanted,
                about=what,
            )

    def _say_who_is_missing(self, status: Status, now_s: float) -> None:
        """Say once, after a while, that nobody is there to do the work."""
        there = {"worker": status.workers, "analyzer": status.analyzers}
        missing = [kind for kind, count in there.items() if not count]
        if not missing:
            self._waits_since = None
        elif self._waits_since is None:
            self._waits_since = now_s
        elif now_s - self._waits_since > SPAN_S:
            self._waits_since = now_s + 6 * SPAN_S
            self._console.print(f"waiting: no {' and no '.join(missing)} has joined")
        waiting = {
            f"arena {shard} of {run.held.path.name}": platform
            for run in self._scheduler.active
            for shard, platform in run.loop.shard_requests.waiting.items()
        }
        if "worker" not in missing and waiting != self._said_waiting:
            self._said_waiting = waiting
            for shard, platform in waiting.items():
                self._console.print(
                    f"waiting: no worker of platform {platform} is there to go on "
                    f"with {shard}; others would come to other results (--allow-drift)",
                    soft_wrap=True,
                )


def _line(status: Status) -> str:
    """Return the state in a line, for a log."""
    about = f"{status.births} of {status.wanted} births, {_pace(status)}"
    if len(status.runs) == 1:
        about += f"{about_arenas(status.runs[0])}"
    else:
        done = sum(run.state == "finished" for run in status.runs)
        about = f"{done} of {len(status.runs)} runs, {about}"
    return f"{about}, {_process_pool(status)}"


def _pace(status: Status) -> str:
    return f"{status.births_per_s:.1f}/s, {duration(status.left_s)} left"


def _process_pool(status: Status) -> str:
    return f"{status.workers} workers"
