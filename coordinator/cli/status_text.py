"""Status of runs as text: of ``revolve status``, of the display, of a run's end."""

from collections.abc import Callable, Sequence
from itertools import chain

from rich.console import Console
from rich.table import Table

from coordinator.dispatch.faults import MEANINGS
from schema.errors import counted, rounded
from schema.experiment.identity import Group
from schema.limits import printable
from schema.wire.status import IslandStatus, PeerFault, RunStatus, Status

_MOST_PEERS = 5
_MOST_NAMED = 8
"""Islands that a line names."""
_MOST_BESTS = 8
"""Islands whose best fitness fits a line."""
_MEANINGS = {str(kind): meaning for kind, meaning in MEANINGS.items()}
_UNITS_S = ((86400, 3600, "{} d {} h"), (3600, 60, "{} h {:02} min"),
            (60, 1, "{} min {:02} s"))  # fmt: skip
_WIDEST = 1000
"""Characters of the widest line that is not wrapped."""


def duration(seconds: float | None) -> str:
    """Return a duration as text, such as "2 h 05 min"; "?" if it is unknown."""
    if seconds is None:
        return "?"
    whole = round(seconds)
    for unit_s, part_s, form in _UNITS_S:
        if whole >= unit_s:
            return form.format(whole // unit_s, whole % unit_s // part_s)
    return f"{whole} s"


def time_left(status: Status) -> str:
    """Return the time until all runs are finished, as far as it is known."""
    return f"{duration(status.left_s)} left"


def pace(status: Status) -> str:
    """Return the rate of births and the number of workers."""
    return f"{status.births_per_s:.1f} births/s, {counted(status.workers, 'worker')}"


def births_done(status: Status) -> str:
    """Return how many births there are, and how many there will be."""
    return f"{status.births} of {counted(status.wanted, 'birth')}"


def runs_done(status: Status) -> str:
    """Return how many runs are finished, of how many."""
    done = sum(run.state == "finished" for run in status.runs)
    return f"{done} of {counted(len(status.runs), 'run')}"


def run_details(run: RunStatus) -> str:
    """Return the best fitness of a run, and the state of its arenas."""
    return f"{best_text(run.islands)}{about_arenas(run)}"


def best_text(islands: Sequence[IslandStatus]) -> str:
    """Return the best fitness of the living robots, per island if there are few."""
    bests = [island.best for island in islands]
    judged = [best for best in bests if best is not None]
    if not judged:
        return "best -"
    if not 1 < len(bests) <= _MOST_BESTS:
        bests = [max(judged)]
    texts = ("-" if best is None else rounded(best, 3) for best in bests)
    return f"best {' '.join(texts)}"


def about_arenas(run: RunStatus) -> str:
    """Return simulated time and number of robots of a run's arenas, if it has any."""
    arenas = [island for island in run.islands if island.simulated_s is not None]
    if not arenas:
        return ""
    simulated_s = sum(island.simulated_s or 0.0 for island in arenas)
    alive = sum(island.alive for island in arenas)
    pace = ", paused" if any(island.is_paused for island in arenas) else ""
    if run.simulated_per_s:
        pace = f"{pace}, {run.simulated_per_s:.1f} x real time"
    return f", {simulated_s:.0f} s simulated, {alive} alive{pace}"


def missing_agents(status: Status) -> list[str]:
    """Return the kinds of agents that a coordinator lacks, in the plural.

    A run that is finished, and keeps its migrants for other groups, needs none.
    """
    if all(run.state == "finished" for run in status.runs):
        return []
    counts = {"workers": status.workers, "analyzers": status.analyzers}
    return [kind for kind, count in counts.items() if not count]


def waiting_text(missing: Sequence[str]) -> str:
    """Return what runs wait for, given the kinds of agents that are missing."""
    return f"waiting for {' and '.join(missing)}"


def part_lines(status: Status) -> list[str]:
    """Return a line for each arena that several workers advance."""
    lines = []
    for run in status.runs:
        for number, island in run.numbered:
            if island.parts:
                parts = ", ".join(
                    f"{one.worker} {counted(one.robots, 'robot')} "
                    f"({one.cost:.0%} of the cost, {one.came} came)"
                    for one in island.parts
                )
                again = counted(island.repeats, "repeated exchange")
                lines.append(f"arena {number}: {parts}; {again}")
    return [printable(line, _WIDEST) for line in lines]


def group_lines(run: RunStatus, *, only_silent: bool = False) -> list[str]:
    """Return what a group of islands waits for: migrants, or groups that need them.

    ``only_silent``: leave out groups that answer.
    """
    lines = []
    for number in range(run.group.of):
        other = Group(number=number, of=run.group.of)
        is_silent = number in run.silent_groups
        if only_silent and not is_silent:
            continue
        silence = ", which does not answer" * is_silent
        waiting = {
            island: [each for each in status.awaited if each % run.group.of == number]
            for island, status in run.numbered
        }
        if any(waiting.values()):
            here = _listed([island for island, awaited in waiting.items() if awaited])
            there = _listed(sorted({*chain(*waiting.values())}))
            verb = "waits" if here.startswith("island ") else "wait"
            lines.append(f"{here} {verb} for {there} of group {other}{silence}")
        if run.state == "finished" and number in run.unserved_groups:
            lines.append(f"finished; keeps its migrants for group {other}{silence}")
    return [f"group {run.group}: {line}" for line in lines]


def _listed(islands: Sequence[int]) -> str:
    """Return the names of islands, of which there is one at least."""
    names = ", ".join(map(str, islands[:_MOST_NAMED]))
    more = f" and {len(islands) - _MOST_NAMED} more" * (len(islands) > _MOST_NAMED)
    return f"island{'s' * (len(islands) > 1)} {names}{more}"


def trouble_lines(status: Status) -> list[str]:
    """Return lines about agents that do not answer, and about faults of peers."""
    held = ", ".join(
        f"{name} holds {counted(jobs, 'job')}" for name, jobs in status.silent.items()
    )
    silent = [f"no answer and no progress: {held}"] if held else []
    lines = [*silent, *fault_lines(status.faults)]
    return [printable(line, _WIDEST) for line in lines]


def fault_lines(faults: Sequence[PeerFault]) -> list[str]:
    """Return a line for each kind of fault: its total, and the peers with the most."""
    lines = []
    for kind in sorted({fault.kind for fault in faults}):
        of_kind = sorted(
            (fault for fault in faults if fault.kind == kind),
            key=lambda fault: (-fault.count, fault.peer),
        )
        total = sum(fault.count for fault in of_kind)
        peers = ", ".join(f"{one.peer} {one.count}" for one in of_kind[:_MOST_PEERS])
        more = f" and {len(of_kind) - _MOST_PEERS} more" * (len(of_kind) > _MOST_PEERS)
        # A coordinator of another version may have other kinds.
        meaning = f"{_MEANINGS[kind]}; " if kind in _MEANINGS else ""
        lines.append(
            f"not used: {total} {kind}: {peers}{more} ({meaning}since the start)"
        )
    return lines


Cells = Callable[[RunStatus], str]

_COLUMNS: dict[str, Cells] = {
    "births": lambda run: f"{run.births} of {run.wanted}" if run.islands else "",
    "births/s": lambda run: f"{run.births_per_s:.1f}" if run.births_per_s else "",
    "best of population, arenas": lambda run: run_details(run) if run.islands else "",
}
"""Texts of a run in the columns of a table, after its name and its state."""


def run_table(status: Status, name_of: Cells, *, is_live: bool) -> Table:
    """Return a table of runs without the columns that are empty in all rows."""
    missing = missing_agents(status) if is_live else []
    waits = {"running": waiting_text(missing)} if missing else {}
    columns: dict[str, Cells] = {
        "run": name_of,
        "state": lambda run: waits.get(run.state, run.state),
        **_COLUMNS,
    }
    cells = {head: [*map(text, status.runs)] for head, text in columns.items()}
    return table_of({head: own for head, own in cells.items() if any(own)})


def table_of(columns: dict[str, list[str]], **settings: str) -> Table:
    """Return a table without lines."""
    table = Table(box=None, pad_edge=False)
    for number, head in enumerate(columns):
        table.add_column(head, **(settings if number else {}))  # type: ignore[arg-type]
    for row in zip(*columns.values(), strict=True):
        table.add_row(*row)
    return table


def show(*lines: str | Table) -> None:
    """Print lines and tables on standard output, wrapped where needed but never cut."""
    console = Console(width=_WIDEST, highlight=False, markup=False)
    for line in lines:
        console.print(line)
