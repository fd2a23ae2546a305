"""Table at the end of a campaign: the outcome of each experiment."""

import json
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path
from statistics import fmean, stdev

from coordinator.cli.status_text import duration, show, table_of
from coordinator.storage.folder_status import folder_status
from schema.errors import RevolveError, rounded
from schema.experiment.file import experiment_from_text
from schema.experiment.fitness_keys import fitness_text
from schema.tables.files import read_table


@dataclass(frozen=True, slots=True)
class RunOutcome:
    """Outcome of one run of a campaign.

    Attributes:
        best: fitness of the best robot of the last population; None: there is none.
        took_s: from start to end by the clock, pauses included [s]; None: no end.
        has_failed: it was not finished, or no evaluation succeeded.
        point: settings that a sweep chose, as text; empty without a sweep.
    """

    experiment: str
    best: float | None = None
    took_s: float | None = None
    has_failed: bool = False
    function: str = ""
    point: str = ""


def outcome_of(folder: Path, experiment: str, *, has_failed: bool) -> RunOutcome:
    """Return the outcome of a run from its folder, which may be damaged."""
    if has_failed:
        return RunOutcome(experiment, has_failed=True)
    try:
        bests = [island.best for island in folder_status(folder).islands]
        (row,) = read_table(folder, "runs").to_pylist()
        document = experiment_from_text(row["document"])
        function = fitness_text(document)
        chosen = document.sweep.chosen if document.sweep else {}
    except (RevolveError, ValueError):
        return RunOutcome(experiment, has_failed=True)
    return RunOutcome(
        experiment,
        best=max((best for best in bests if best is not None), default=None),
        took_s=(row["end"] - row["start"]).total_seconds() if row["end"] else None,
        function=function,
        point=", ".join(
            f"{key} = {json.dumps(value)}" for key, value in chosen.items()
        ),
    )


def _or_dash(
    number: Callable[[list[float]], float], text: Callable[[float], str], least: int = 1
) -> Callable[[list[float]], str]:
    """Return what writes a number of a sample, "-" of one that is too small."""
    return lambda sample: text(number(sample)) if len(sample) >= least else "-"


_BESTS = {
    "best": _or_dash(max, rounded),
    "mean of bests": _or_dash(fmean, rounded),
    "sd": _or_dash(stdev, rounded, least=2),
}
"""Columns of the fitness of each run's best robot; the last is that of a sample."""


def columns(outcomes: Iterable[RunOutcome]) -> dict[str, list[str]]:
    """Return the cells of each column, one per experiment in order of appearance."""
    groups: dict[str, list[RunOutcome]] = {}
    for outcome in outcomes:
        groups.setdefault(outcome.experiment, []).append(outcome)
    runs = groups.values()
    bests = [[run.best for run in own if run.best is not None] for own in runs]
    times_s = [[run.took_s for run in own if run.took_s is not None] for own in runs]
    return {
        "experiment": [*groups],
        "runs": [str(len(own)) for own in runs],
        **{head: [*map(text, bests)] for head, text in _BESTS.items()},
        "time per run": [*map(_or_dash(fmean, duration), times_s)],
        "failed": [str(sum(run.has_failed for run in own)) for own in runs],
    }


def show_outcomes(outcomes: Iterable[RunOutcome]) -> None:
    """Print the table on standard output, with lines that explain it."""
    known = list(outcomes)
    points = {run.experiment: run.point for run in known if run.point}
    functions = {run.experiment: run.function for run in known if run.function}
    lines = [f"{name}: {point}" for name, point in points.items()]
    if len(set(functions.values())) > 1:
        lists = ", ".join(f"{name} {text}" for name, text in functions.items())
        lines.append(f"not comparable, as fitness functions differ: {lists}")
    table = table_of(columns(known), justify="right")
    show(table, "fitness of each run's best robot in its last population", *lines)
