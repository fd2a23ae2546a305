"""What ``revolve analyze`` says when it is done: populations, findings, left out."""

from collections.abc import Sequence
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc
from rich.cells import cell_len
from rich.console import Console
from rich.table import Table
from rich.text import Text

_FITNESS = ("fitness", "fitness_best")
_BORDERS, _BORDER = 3, 1
"""Characters that a column takes beside its cells, and the table beside those."""
_FOLDED = 12
"""Characters that a column of words is not folded below."""


def show(tables: dict[str, pa.Table], console: Console) -> None:
    """Print each run's last populations, the findings, and what was left out.

    Args:
        tables: as ``analysis.measures.outputs`` names them.
        console: to print on; however narrow, nothing is cut.
    """
    populations = _last_populations(tables["populations"])
    if populations:
        heads = ("experiment", "run", "births", "size", "mean fitness", "best")
        _print_table(console, heads, populations, words={0, 1})
    else:
        _print_line(console, "no population could be measured")
    if findings := _findings(tables["findings"]):
        heads = ("figure", "finding of the thesis", "a", "b", "q", "verdict")
        _print_table(console, heads, findings, words={1, 5})
    for name, differs in _renamed(tables["runs"]).items():
        _print_line(console, f"{name}: {differs}")
    for row in tables["left_out"].to_pylist():
        whose = f"{row['folder']}: " if row["folder"] else ""
        _print_line(console, f"left out: {whose}{row['what']}: {row['why']}")


def _print_line(console: Console, line: str) -> None:
    """Print a line as it is; a terminal wraps it, a file does not."""
    console.print(line, soft_wrap=True, markup=False, highlight=False)


def _print_table(
    console: Console,
    heads: Sequence[str],
    rows: Sequence[Sequence[str]],
    words: set[int],
) -> None:
    """Print rows as a table, or where it is too narrow for one each as a line.

    Args:
        console: to print on.
        heads: of the columns.
        rows: cells.
        words: columns that may be folded; the others are numbers.
    """
    table = Table()
    needed = _BORDER
    for column, head in enumerate(heads):
        longest = max(map(cell_len, (head, *(row[column] for row in rows))))
        if column in words:
            table.add_column(head, overflow="fold")
            longest = min(longest, _FOLDED)
        else:
            table.add_column(head, no_wrap=True)
        needed += longest + _BORDERS
    if needed > console.width:
        for row in rows:
            told = (f"{head} {cell}" for head, cell in zip(heads, row, strict=True))
            _print_line(console, ", ".join(told))
        return
    for row in rows:
        table.add_row(*map(Text, row))
    console.print(table)


def _last_populations(populations: pa.Table) -> list[tuple[str, ...]]:
    """Return experiment, run, births, size, mean and best of each island's last."""
    keys = ["experiment", "folder", "island"]
    last = populations.group_by(keys, use_threads=False).aggregate([("births", "max")])
    joined = populations.join(last, keys)
    rows = joined.filter(pc.equal(joined["births"], joined["births_max"]))
    return [
        (
            row["experiment"],
            Path(row["folder"]).name + (f" {row['island']}" if row["island"] else ""),
            str(row["births"]),
            str(row["judged"]),
            *("-" if row[name] is None else f"{row[name]:.4f}" for name in _FITNESS),
        )
        for row in rows.sort_by([(key, "ascending") for key in keys]).to_pylist()
    ]


def _findings(findings: pa.Table) -> list[tuple[str, ...]]:
    """Return figure, claim, means of a and b, q and verdict of what was compared."""
    compared = findings.filter(pc.field("runs_a").is_valid())
    return [
        (
            row["figure"],
            row["claim"],
            *(f"{row[name]:.3g}" for name in ("mean_a", "mean_b", "q")),
            row["verdict"],
        )
        for row in compared.to_pylist()
    ]


def _renamed(runs: pa.Table) -> dict[str, str]:
    """Return experiments that another one shares a name with, and how they differ."""
    rows = runs.filter(pc.not_equal(runs["differs"], "")).to_pylist()
    return {row["experiment"]: row["differs"] for row in rows}
