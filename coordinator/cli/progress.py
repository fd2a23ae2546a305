"""Progress of a coordinator's runs on the terminal: bars, or lines in a log."""

import math
from collections.abc import Iterator, Sequence
from typing import Self

from rich.console import Console
from rich.progress import (
    BarColumn,
    MofNCompleteColumn,
    Progress,
    ProgressColumn,
    TaskID,
    TextColumn,
)
from rich.table import Column

from coordinator.cli.format import (
    about_arenas,
    best_text,
    duration,
    missing_agents,
    run_details,
)
from coordinator.run.scheduler import RunScheduler
from coordinator.run.session import RunSession
from coordinator.storage.hints import command
from schema.agent.log import log_form, tell_user, warn_user
from schema.errors import counted
from schema.plugins.permission import FLAG
from schema.wire.status import IslandStatus, RunStatus, Status

MOST_BARS = 16
"""Bars of single runs or islands that fit on a screen."""
_LINE_S = 10.0
"""Time between two lines of progress, where there is no terminal [s]."""
_SOON_S = 2.0
"""Time after which a run says how to start the agents that it waits for [s]."""
_LEAST_FOR_BAR = 60
"""Characters of the narrowest terminal that has room for a bar."""


class Display:
    """Progress bars; without a terminal a line at regular intervals."""

    def __init__(
        self,
        scheduler: RunScheduler,
        *,
        quiet: bool,
        console: Console | None = None,
        place: str = "",
        plugins: Sequence[str] = (),
    ) -> None:
        """Show all runs of a scheduler; if ``quiet``, only what they wait for.

        Args:
            scheduler: its runs.
            quiet: show no progress.
            console: where to draw; None: on standard error.
            place: to which the user has to connect agents; empty: this command has
                started some.
            plugins: modules and files that these agents need to import.
        """
        self._scheduler = scheduler
        self._console = console or Console(stderr=True)
        self._quiet = quiet
        self._place = place
        self._flags = [word for each in plugins for word in (FLAG, each)]
        self._patience_s = _SOON_S if place and not quiet else _LINE_S
        # Bars would break lines of JSON.
        self._has_bars = self._console.is_terminal and log_form() != "json"
        self._progress = Progress(
            *_columns(self._console.width),
            console=self._console,
            disable=quiet or not self._has_bars,
            expand=True,
        )
        self._tasks: dict[str, TaskID] = {}
        self._next_line_s = -math.inf
        self._missing: list[str] = []
        self._missing_since_s: float | None = None
        self._shown_waiting: set[str] = set()

    def __enter__(self) -> Self:
        """Start drawing."""
        self._progress.start()
        return self

    def __exit__(self, *_error: object) -> None:
        """Stop drawing; the last state stays on the screen."""
        self._progress.stop()

    def update(self, now_s: float) -> None:
        """Show the present state.

        Args:
            now_s: the time, of any clock that only goes forward [s].
        """
        status = self._scheduler.status(now_s)
        if self._quiet:
            pass
        elif self._has_bars:
            self._draw(status)
        elif now_s >= self._next_line_s:
            self._next_line_s = now_s + _LINE_S
            tell_user(", ".join([_line(status), *self._recoveries()]))
        self._warn_of_missing(status, now_s)

    def _recoveries(self) -> list[str]:
        """Describe the runs whose lost poses are computed again."""
        return [
            "recomputing poses of {}: advance {} of {}".format(
                run.held.path.name, *run.recovery.progress
            )
            for run in self._scheduler.active
            if run.recovery is not None
        ]

    def _draw(self, status: Status) -> None:
        rows: dict[str, tuple[IslandStatus | RunStatus | Status, str]] = {}
        left = f"{duration(status.left_s)} left"
        rates = ", ".join([_pace(status), *self._recoveries()])
        if len(status.runs) > 1:
            name = _runs_done(status)
            rows[""] = (status, f"{left}, {rates}")
            active = [run for run in status.runs if run.state == "running"]
            for run in active[:MOST_BARS]:
                rows[f"{run.name}-{run.run}"] = (run, run_details(run))
        else:
            (run,) = status.runs
            name = run.name
            rows[""] = (run, f"{left}, {best_text(run)}, {rates}{about_arenas(run)}")
            islands = run.islands if 1 < len(run.islands) <= MOST_BARS else ()
            for number, island in enumerate(islands):
                rows[f"  island {number}"] = (island, best_text(island))
        for gone in [key for key in self._tasks if key not in rows]:
            self._progress.remove_task(self._tasks.pop(gone))
        for key, (shown, what) in rows.items():
            if key not in self._tasks:
                self._tasks[key] = self._progress.add_task(key, about="")
            self._progress.update(
                self._tasks[key],
                description=key or name,
                completed=shown.births,
                total=shown.wanted,
                about=what,
            )

    def _warn_of_missing(self, status: Status, now_s: float) -> None:
        """Warn of missing kinds of agents, and of arenas without a suitable worker."""
        missing = missing_agents(status)
        if not missing:
            self._missing_since_s = None
        elif self._missing_since_s is None or missing != self._missing:
            self._missing, self._missing_since_s = missing, now_s
        elif now_s - self._missing_since_s > self._patience_s:
            self._missing_since_s = now_s + 6 * _LINE_S
            is_refused = any(each.kind == "refused" for each in status.faults)
            who = (
                "none that is connected can do the jobs"
                if is_refused
                else "none is connected"
            )
            line = f"waiting for {' and '.join(missing)}: {who}"
            starts = [
                command(kind.removesuffix("s"), "--connect", self._place, *self._flags)
                for kind in missing
            ]
            how = f"; to start some on this machine: {', '.join(starts)}"
            self._warn(f"{line}{how if self._place else ''}")
        active = self._scheduler.active
        waiting = [line for run in active for line in _waiting(run, missing)]
        for line in waiting:
            if line not in self._shown_waiting:
                self._warn(f"waiting: {line}")
        self._shown_waiting = set(waiting)

    def _warn(self, line: str) -> None:
        if self._has_bars and not self._quiet:
            # Names and platforms are texts of others: brackets are no markup.
            self._console.print(line, soft_wrap=True, markup=False, highlight=False)
        else:
            warn_user(line)


def _waiting(run: RunSession, missing: Sequence[str]) -> Iterator[str]:
    """Yield what a run waits for although its coordinator has agents.

    Args:
        run: the run.
        missing: kinds of agents of which no run has one.
    """
    kinds = [f"{kind}s" for kind in run.lacking]
    lacking = [kind for kind in kinds if kind not in missing]
    name = run.held.path.name
    if lacking:
        yield f"{name}: none of the {' and '.join(lacking)} can do its jobs"
    elif "workers" not in missing:
        for arena, platform in run.waiting.items():
            yield (
                f"arena {arena} of {name} needs a worker of platform {platform}; on "
                "another platform its results differ (--allow-drift)"
            )


def _line(status: Status) -> str:
    """Return the state as one line of a log."""
    about = f"{status.births} of {counted(status.wanted, 'birth')}, {_rates(status)}"
    if len(status.runs) == 1:
        return f"{about}{about_arenas(status.runs[0])}"
    return f"{_runs_done(status)}, {about}"


def _runs_done(status: Status) -> str:
    done = sum(run.state == "finished" for run in status.runs)
    return f"{done} of {counted(len(status.runs), 'run')}"


def _rates(status: Status) -> str:
    left = f"{duration(status.left_s)} left"
    return f"{status.births_per_s:.1f}/s, {left}, {counted(status.workers, 'worker')}"


def _pace(status: Status) -> str:
    return f"{status.births_per_s:.1f} births/s, {counted(status.workers, 'worker')}"


def _columns(width: int) -> list[ProgressColumn]:
    """Return the columns of the bars: the count first, the least important last.

    Only the last one is cut where the terminal is narrow.

    Args:
        width: of the terminal in characters.
    """
    name = Column(no_wrap=True, overflow="ellipsis", max_width=max(12, width // 3))
    rest = Column(no_wrap=True, overflow="ellipsis", ratio=1)
    bar = [BarColumn(bar_width=width // 8)] if width >= _LEAST_FOR_BAR else []
    return [
        MofNCompleteColumn(table_column=Column(no_wrap=True, justify="right")),
        TextColumn("{task.description}", markup=False, table_column=name),
        *bar,
        TextColumn("{task.fields[about]}", markup=False, table_column=rest),
    ]
