"""Progress of a coordinator's runs on the terminal: bars, or lines in a log."""

import math
from collections.abc import Iterator, Sequence
from typing import Self

from rich.console import Console, RenderableType
from rich.live import Live
from rich.progress_bar import ProgressBar
from rich.table import Column, Table
from rich.text import Text

from coordinator.cli.status_text import (
    about_arenas,
    best_text,
    births_done,
    group_lines,
    missing_agents,
    pace,
    run_details,
    runs_done,
    time_left,
    waiting_text,
)
from coordinator.run.scheduler import RunScheduler
from coordinator.run.session import RunSession
from coordinator.storage.hints import command
from schema.agent.log import log_form, tell_user, warn_user
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
        scheduler: RunScheduler | None,
        *,
        quiet: bool,
        console: Console | None = None,
        place: str = "",
        plugins: Sequence[str] = (),
    ) -> None:
        """Show all runs of a scheduler; if ``quiet``, only what they wait for.

        Without a scheduler it shows what ``show`` gets.

        The user has to connect agents to ``place``, which import ``plugins``; it is
        empty if this command has started some.
        """
        self._scheduler = scheduler
        self._console = console or Console(stderr=True)
        self._quiet = quiet
        self._place = place
        self._flags = [word for each in plugins for word in (FLAG, each)]
        self._patience_s = _SOON_S if place and not quiet else _LINE_S
        # Bars would break lines of JSON.
        is_terminal = self._console.is_terminal and log_form() != "json"
        self._has_bars = is_terminal and not quiet
        self._live = Live(console=self._console, auto_refresh=False)
        self._next_line_s = -math.inf
        self._missing: list[str] = []
        self._missing_since_s: float | None = None
        self._shown_waiting: set[str] = set()

    def __enter__(self) -> Self:
        """Start drawing."""
        if self._has_bars:
            self._live.start()
        return self

    def __exit__(self, *_error: object) -> None:
        """Stop drawing; the last state stays on the screen."""
        self._live.stop()

    def update(self, now_s: float) -> None:
        """Show the present state, and warn of what the runs wait for."""
        assert self._scheduler is not None
        status = self._scheduler.status(now_s)
        self.show(status, now_s)
        self._warn_of_missing(status, now_s)

    def show(self, status: Status, now_s: float) -> None:
        """Show a state."""
        if self._has_bars:
            bars = _bars(status, self._recoveries(), self._console.width)
            self._live.update(bars, refresh=True)
        elif now_s >= self._next_line_s and not self._quiet:
            self._next_line_s = now_s + _LINE_S
            tell_user(", ".join([_line(status), *self._recoveries()]))

    @property
    def _active(self) -> list[RunSession]:
        return self._scheduler.active if self._scheduler else []

    def _recoveries(self) -> list[str]:
        return [
            "recomputing poses of {}: advance {} of {}".format(
                run.held.path.name, *run.recovery.progress
            )
            for run in self._active
            if run.recovery is not None
        ]

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
            line = f"{waiting_text(missing)}: {who}"
            starts = [
                command(kind.removesuffix("s"), "--connect", self._place, *self._flags)
                for kind in missing
            ]
            how = f"; to start some on this machine: {', '.join(starts)}"
            self._warn(f"{line}{how if self._place else ''}")
        active = self._active
        waiting = [line for run in active for line in _waiting(run, missing)]
        for run in status.runs:
            waiting += group_lines(run, only_silent=True)
        for line in waiting:
            if line not in self._shown_waiting:
                self._warn(f"waiting: {line}")
        self._shown_waiting = set(waiting)

    def _warn(self, line: str) -> None:
        if self._has_bars:
            # Names and platforms are texts of others: brackets are no markup.
            self._console.print(line, soft_wrap=True, markup=False, highlight=False)
        else:
            warn_user(line)


def _waiting(run: RunSession, missing: Sequence[str]) -> Iterator[str]:
    """Yield what a run waits for although its coordinator has agents."""
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
    line = f"{births_done(status)}, {pace(status)}, {time_left(status)}"
    if len(status.runs) == 1:
        return f"{line}{about_arenas(status.runs[0])}"
    return f"{runs_done(status)}, {line}"


Counted = IslandStatus | RunStatus | Status


def _rows(status: Status, notes: Sequence[str]) -> Iterator[tuple[str, Counted, str]]:
    """Yield name, births and details of all runs together, then of some parts."""
    left, rates = time_left(status), ", ".join([pace(status), *notes])
    if len(status.runs) > 1:
        yield runs_done(status), status, f"{left}, {rates}"
        active = [run for run in status.runs if run.state == "running"]
        for run in active[:MOST_BARS]:
            is_group = run.group.of > 1
            title = f"group {run.group}" if is_group else f"{run.name}-{run.run}"
            yield title, run, run_details(run)
        return
    (run,) = status.runs
    details = f"{left}, {best_text(run.islands)}, {rates}{about_arenas(run)}"
    yield run.name, run, details
    for number, island in run.numbered:
        if 1 < len(run.islands) <= MOST_BARS:
            yield f"  island {number}", island, best_text([island])


def _bars(status: Status, notes: Sequence[str], width: int) -> Table:
    """Return a row of each bar: the count first, the least important last.

    Only the last column is cut where the terminal is narrow.
    """
    name = Column(no_wrap=True, overflow="ellipsis", max_width=max(12, width // 3))
    rest = Column(no_wrap=True, overflow="ellipsis", ratio=1)
    bar = [Column()] if width >= _LEAST_FOR_BAR else []
    count = Column(no_wrap=True, justify="right")
    table = Table.grid(count, name, *bar, rest, padding=(0, 1), expand=True)
    for title, part, details in _rows(status, notes):
        total = str(part.wanted)
        cells: list[RenderableType] = [
            Text(f"{part.births:{len(total)}}/{total}", "progress.download"),
            Text(title),
        ]
        if bar:
            done = min(part.births, part.wanted)
            cells.append(ProgressBar(part.wanted, done, width=width // 8))
        table.add_row(*cells, Text(details))
    return table
