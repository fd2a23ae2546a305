"""Table of fitness under changes of the simulation, and what it comes to.

Each row is one robot under one change. A share is the fitness there divided by the
fitness without changes; it is null if the evaluation failed or that fitness is not
positive.
"""

from collections.abc import Callable, Iterable, Sequence
from statistics import fmean, median
from typing import Any

import pyarrow as pa

from schema.errors import rounded
from schema.experiment.settings import LATER_WINDOW
from schema.robot.results import sustained

Row = dict[str, Any]

Columns = dict[str, tuple[pa.DataType, str]]
"""Types and meanings of columns."""

ROBOT: Columns = {
    "experiment": (pa.string(), "name of the experiment"),
    "folder": (pa.string(), "path of the run folder"),
    "island": (pa.int32(), "island of birth"),
    "birth": (pa.int64(), "number of birth there"),
    "is_best": (pa.bool_(), "whether it is the best ever, of the greatest fitness"),
    "is_last": (pa.bool_(), "whether it is in an island's last population"),
    "recorded": (pa.float64(), "last recorded fitness"),
    "undisturbed": (
        pa.float64(),
        "fitness alone without changes; null if the evaluation failed",
    ),
}
"""Columns that say which robot is re-evaluated."""
RESULT: Columns = {
    "fitness": (pa.float64(), "fitness under it; null if the evaluation failed"),
    "share": (pa.float64(), "fitness divided by undisturbed; null if that is not > 0"),
    "failure": (pa.string(), "why an evaluation failed; empty if none did"),
}
"""Columns of the result of an evaluation under a change."""

COLUMNS: Columns = {
    **ROBOT,
    "group": (pa.string(), "what is changed"),
    "change": (pa.string(), "the change in words"),
    **RESULT,
}


def table_of(rows: Iterable[Row], columns: Columns) -> pa.Table:
    """Return the table of rows that have all columns but ``share``."""
    schema = pa.schema(
        [
            pa.field(name, kind, metadata={"meaning": meaning})
            for name, (kind, meaning) in columns.items()
        ]
    )
    return pa.Table.from_pylist([{**row, "share": _share(row)} for row in rows], schema)


def _share(row: Row) -> float | None:
    fitness, undisturbed = row["fitness"], row["undisturbed"]
    if fitness is None or undisturbed is None or undisturbed <= 0:
        return None
    return float(fitness / undisturbed)


def kept(rows: Sequence[Row]) -> float | None:
    """Return the share of its fitness that one robot keeps; None if there is none.

    The mean over groups of the mean over the changes of a group, so that groups of many
    changes count no more than others. Failed evaluations and later windows are left
    out.
    """
    groups: dict[str, list[float]] = {}
    for row in _disturbed(rows):
        if row["share"] is not None:
            groups.setdefault(row["group"], []).append(row["share"])
    return fmean(map(fmean, groups.values())) if groups else None


def _disturbed(rows: Sequence[Row]) -> list[Row]:
    return [row for row in rows if row["group"] != LATER_WINDOW]


def lasting_share(rows: Sequence[Row]) -> float | None:
    """Return the share of its fitness that one robot sustains in later windows."""
    later = [row["fitness"] for row in rows if row["group"] == LATER_WINDOW]
    return sustained(rows[0]["undisturbed"], later) if later else None


def summary(table: pa.Table) -> str:
    """Return one line that says how much of its fitness a run keeps."""
    return line_of(table, _of_best, _of_last)


def line_of(
    table: pa.Table,
    of_best: Callable[[str, Sequence[Row]], str],
    of_last: Callable[[Sequence[Sequence[Row]]], str],
) -> str:
    """Return a line about a run's best robot ever, last population, and failures.

    ``of_best`` describes a named robot of positive fitness by its rows, ``of_last``
    several by the rows of each.
    """
    robots: dict[tuple[int, int], list[Row]] = {}
    rows = table.to_pylist()
    for row in rows:
        robots.setdefault((row["island"], row["birth"]), []).append(row)
    best = next(own for own in robots.values() if own[0]["is_best"])
    last = [own for own in robots.values() if own[0]["is_last"]]
    name = f"the best ever, {best[0]['island']}:{best[0]['birth']}"
    undisturbed = best[0]["undisturbed"]
    if undisturbed is None:
        text = f"{name}, has no fitness without changes"
    elif undisturbed <= 0:
        text = f"{name}, has a fitness of {rounded(undisturbed)} without changes"
    else:
        text = of_best(name, best)
    texts = [text, of_last(last)]
    if failed := sum(row["fitness"] is None for row in rows):
        texts.append(f"{failed} of {len(rows)} evaluations failed")
    return "; ".join(filter(None, texts))


def _of_last(robots: Sequence[Sequence[Row]]) -> str:
    shares = [share for rows in robots if (share := kept(rows)) is not None]
    if not shares:
        return ""
    lasting = [share for rows in robots if (share := lasting_share(rows)) is not None]
    text = (
        f"the last population of {len(robots)} keeps {percent(median(shares))} in "
        f"the median, {percent(min(shares))} to {percent(max(shares))}"
    )
    if lasting:
        text += f", and sustains {percent(median(lasting))} in later windows"
    return text


def _of_best(name: str, rows: Sequence[Row]) -> str:
    share, fitness = kept(rows), rounded(rows[0]["undisturbed"])
    if share is None:
        return f"{name}, has a fitness of {fitness} without changes"
    known = sorted(
        (row["share"], row["change"])
        for row in _disturbed(rows)
        if row["share"] is not None
    )
    (low, worst), (high, gain) = known[0], known[-1]
    return (
        f"{name}, keeps {percent(share)} of its fitness ({fitness}) on average, from "
        f"{percent(low)} under {worst} to {percent(high)} under {gain}{_lasting(rows)}"
    )


def _lasting(rows: Sequence[Row]) -> str:
    share = lasting_share(rows)
    return "" if share is None else f", and sustains {percent(share)} in later windows"


def percent(share: float) -> str:
    """Return a share as text."""
    return f"{100 * share:.0f} %"
