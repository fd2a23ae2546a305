"""Summary that ``revolve analyze`` prints: populations, findings, what was left out."""

from collections.abc import Mapping, Sequence
from pathlib import Path

import pyarrow as pa
import pyarrow.compute as pc
from rich.cells import cell_len
from rich.console import Console
from rich.table import Table
from rich.text import Text

from analysis.measures.fitness_functions import not_compared
from analysis.measures.populations import last_rows
from analysis.measures.winners import sustained_shares
from schema.agent.progress_line import print_line
from schema.errors import rounded

_BORDERS, _BORDER = 3, 1
"""Characters of a column besides its cells, and of a table besides its columns."""
_FOLDED = 12
"""Least width of a folded column of words."""

_HEADS = ("experiment", "run", "births", "judged", "mean of population", "best",
          "sustained")  # fmt: skip


def show(tables: dict[str, pa.Table], console: Console) -> None:
    """Print each run's last populations, the findings, and what was left out.

    Nothing is cut off, however narrow the console is.
    """
    populations = _last_populations(
        tables["populations"], sustained_shares(tables["robots"])
    )
    if populations:
        print_line(console, "last populations:")
        _print_table(console, _HEADS, populations, words={0, 1})
    else:
        print_line(console, "no population could be measured")
    if findings := _findings(tables["findings"]):
        heads = ("figure", "finding of the thesis", "a", "b", "q", "verdict")
        _print_table(console, heads, findings, words={1, 5})
    renamed = tables["runs"].filter(pc.field("differs") != "")
    keys = ["experiment", "differs"]
    for row in renamed.group_by(keys, use_threads=False).aggregate([]).to_pylist():
        print_line(console, f"{row['experiment']}: {row['differs']}")
    for line in not_compared(tables["runs"]):
        print_line(console, line)
    for line in _left_out(tables["left_out"].to_pylist()):
        print_line(console, line)


def _left_out(rows: Sequence[Mapping[str, str]]) -> list[str]:
    """Return a line for each thing that was left out; figures share one line."""
    whys: dict[str, list[str]] = {}
    lines = []
    for row in rows:
        if row["folder"]:
            lines.append(f"left out: {row['folder']}: {row['what']}: {row['why']}")
        else:
            whys.setdefault(row["why"], []).append(row["what"].removeprefix("figure "))
    if whys:
        each = "; ".join(f"{', '.join(names)} ({why})" for why, names in whys.items())
        lines.append(f"left out: figures {each}")
    return lines


def _print_table(
    console: Console,
    heads: Sequence[str],
    rows: Sequence[Sequence[str]],
    words: set[int],
) -> None:
    """Print rows as a table, or as one line each if the console is too narrow.

    Columns of words may be folded; the others are numbers.
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
            cells = (f"{head} {cell}" for head, cell in zip(heads, row, strict=True))
            print_line(console, ", ".join(cells))
        return
    for row in rows:
        table.add_row(*map(Text, row))
    console.print(table)


def _last_populations(
    populations: pa.Table, sustained: Mapping[tuple[str, int], float]
) -> list[tuple[str, ...]]:
    """Return name, run, births, judged robots, mean and best of each island's last.

    What the run's best robot sustains follows on its island. The island is named beside
    the run, unless it is island 0 and the only one.
    """
    rows = last_rows(populations)
    divided = {row["folder"] for row in rows if row["island"]}
    return [
        (
            row["experiment"],
            Path(row["folder"]).name
            + (f" {row['island']}" if row["folder"] in divided else ""),
            str(row["births"]),
            str(row["judged"]),
            *(
                "-" if row[name] is None else rounded(row[name])
                for name in ("fitness", "fitness_best")
            ),
            "-"
            if (share := sustained.get((row["folder"], row["island"]))) is None
            else f"{100 * share:.0f} %",
        )
        for row in rows
    ]


def _findings(findings: pa.Table) -> list[tuple[str, ...]]:
    """Return figure, claim, means of a and b, q and verdict of tested findings."""
    compared = findings.filter(pc.field("runs_a").is_valid())
    return [
        (
            row["figure"],
            row["claim"],
            *(
                "-" if row[name] is None else f"{row[name]:.3g}"
                for name in ("mean_a", "mean_b", "q")
            ),
            row["verdict"],
        )
        for row in compared.to_pylist()
    ]
