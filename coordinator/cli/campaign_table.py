"""Table at the end of a campaign: the outcome of each experiment."""

import json
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean, stdev

from rich.console import Console
from rich.table import Table

from coordinator.cli.format import duration
from coordinator.storage.folder_status import folder_status
from schema.errors import RevolveError, rounded
from schema.experiment.fitness_keys import fitness_text
from schema.tables.files import read_table

_WIDEST = 1000
_HEADS = ("experiment", "runs", "best", "mean of bests", "sd", "time per run",
          "failed")  # fmt: skip


@dataclass(frozen=True, slots=True)
class RunOutcome:
    """Outcome of one run of a campaign.

    Attributes:
        experiment: its name.
        best: fitness of the best robot of the last population; None: there is none.
        took_s: from start to end by the clock, pauses included [s]; None: no end.
        has_failed: it was not finished, or no evaluation succeeded.
        function: fitness functions, as ``fitness_text``; empty if unknown.
        point: settings that a sweep chose, as text; empty without a sweep.
    """

    experiment: str
    best: float | None
    took_s: float | None
    has_failed: bool
    function: str = ""
    point: str = ""


def outcome_of(folder: Path, experiment: str, *, has_failed: bool) -> RunOutcome:
    """Return the outcome of a run from its folder, which may be damaged.

    Args:
        folder: run folder.
        experiment: its name.
        has_failed: as in ``RunOutcome``.
    """
    if has_failed:
        return RunOutcome(experiment, None, None, has_failed=True)
    try:
        bests = [island.best for island in folder_status(folder).islands]
        (row,) = read_table(folder, "runs").to_pylist()
        document = json.loads(row["document"])
        function = fitness_text(document)
        chosen = (document.get("sweep") or {}).get("chosen") or {}
    except (RevolveError, ValueError):
        return RunOutcome(experiment, None, None, has_failed=True)
    judged = [best for best in bests if best is not None]
    took_s = (row["end"] - row["start"]).total_seconds() if row["end"] else None
    best = max(judged, default=None)
    point = ", ".join(f"{key} = {json.dumps(value)}" for key, value in chosen.items())
    return RunOutcome(
        experiment, best, took_s, has_failed=False, function=function, point=point
    )


def rows(outcomes: Iterable[RunOutcome]) -> list[tuple[str, ...]]:
    """Return the cells of the table, one row per experiment in order of appearance.

    Mean and standard deviation are those of the best fitness of the runs; the latter
    is that of a sample, and missing with fewer than two runs.
    """
    groups: dict[str, list[RunOutcome]] = {}
    for outcome in outcomes:
        groups.setdefault(outcome.experiment, []).append(outcome)
    return [_row(name, runs) for name, runs in groups.items()]


def _row(name: str, runs: Sequence[RunOutcome]) -> tuple[str, ...]:
    bests = [run.best for run in runs if run.best is not None]
    times_s = [run.took_s for run in runs if run.took_s is not None]
    return (
        name,
        str(len(runs)),
        rounded(max(bests)) if bests else "-",
        rounded(fmean(bests)) if bests else "-",
        rounded(stdev(bests)) if len(bests) > 1 else "-",
        duration(fmean(times_s)) if times_s else "-",
        str(sum(run.has_failed for run in runs)),
    )


def show(outcomes: Iterable[RunOutcome]) -> None:
    """Print the table on standard output, with a line that explains it.

    Args:
        outcomes: of all runs, in any order.
    """
    table = Table(box=None, pad_edge=False)
    for number, head in enumerate(_HEADS):
        table.add_column(head, justify="right" if number else "left", no_wrap=True)
    known = list(outcomes)
    for cells in rows(known):
        table.add_row(*cells)
    # Wide: a narrow terminal wraps lines, but nothing is cut.
    console = Console(width=_WIDEST, highlight=False, markup=False)
    console.print(table)
    console.print("fitness of each run's best robot in its last population")
    points = {run.experiment: run.point for run in known if run.point}
    for name, point in points.items():
        console.print(f"{name}: {point}")
    functions = {run.experiment: run.function for run in known if run.function}
    if len(set(functions.values())) > 1:
        lists = ", ".join(f"{name} {text}" for name, text in functions.items())
        console.print(f"not comparable, as fitness functions differ: {lists}")
