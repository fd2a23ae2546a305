"""``revolve export``: all runs of a folder as one file."""

from base64 import b64encode
from pathlib import Path
from typing import Any

import msgspec
import pyarrow as pa
from pyarrow import csv, parquet

from revolve.campaign import Runs
from schema.agent.extras import extra
from schema.agent.flags import Flags
from schema.agent.supervisor import cores
from schema.errors import RevolveError, RunFolderError, counted
from schema.tables.columns import TABLES

_OF_TABLES = ("csv", "parquet")


def main(arguments: list[str]) -> int:
    """Write the file, and return the exit code."""
    flags = parser()
    options = flags.parse_args(arguments[1:])
    if options.table and options.to not in _OF_TABLES:
        flags.error(f"--table: is for --to csv and parquet, not {options.to}")
    runs = Runs(options.folder)
    content: pa.Table | str
    if options.to in _OF_TABLES:
        rows = runs.table(options.table or "births")
        content = _flat(rows) if options.to == "csv" else rows
    else:
        content = runs.phylogeny() if options.to == "phylogeny" else _latex(runs)
    try:
        with options.out.open("wb") as file:
            if isinstance(content, str):
                file.write(content.encode())
            elif options.to == "parquet":
                parquet.write_table(content, file)
            else:
                csv.write_csv(content, file)
    except OSError as error:
        why = error.strerror or error
        raise RunFolderError(f"{options.out}: cannot be written: {why}") from None
    size = "" if isinstance(content, str) else f"{counted(len(content), 'row')} of "
    full = [] if content else [name for name in TABLES if len(runs.table(name))]
    hint = f"; tables with rows: {', '.join(full)}" if full else ""
    print(f"{options.out}: {size}{counted(len(runs), 'run')}{hint}")
    return 0


def _latex(runs: Runs) -> str:
    with extra("a comparison needs", "analysis"):
        from analysis.comparison.comparison import comparison, outcomes_of
        from analysis.measures.study import measure_runs
        from analysis.report.latex import comparison_latex
    outcomes = outcomes_of([*measure_runs(runs.loaded, processes=cores())])
    if len(outcomes.experiments) < len("ab"):
        known = ", ".join(outcomes.experiments) or "none"
        rule = "must hold finished runs of at least two experiments"
        raise RevolveError(f"{runs.folder}: {rule} to compare, got {known}")
    return comparison_latex(comparison(outcomes))


def _flat(rows: pa.Table) -> pa.Table:
    """Return rows as CSV can hold them: lists as JSON, bytes in base64."""
    for number, field in enumerate(rows.schema):
        is_bytes = pa.types.is_binary(field.type)
        if is_bytes or pa.types.is_nested(field.type):
            column = [
                _text(each)
                for each in rows[field.name].to_pylist(maps_as_pydicts="strict")
            ]
            rows = rows.set_column(number, field.name, pa.array(column, pa.string()))
    return rows


def _text(value: Any) -> str | None:  # noqa: ANN401 - of any nested column
    if isinstance(value, bytes):
        return b64encode(value).decode()
    return None if value is None else msgspec.json.encode(value).decode()


def parser(_command: str = "export") -> Flags:
    """Return the parser of ``revolve export``."""
    flags = Flags(
        prog="revolve export",
        description="Write a table of all runs of a folder, the comparison of their "
        "experiments, or their phylogeny to one file.",
        examples=(
            "revolve export runs --table population --to csv --out population.csv",
            "revolve export runs/pair --to latex --out comparison.tex",
            "revolve export runs/pair --to phylogeny --out phylogeny.csv",
        ),
    )
    flags.add_argument(
        "folder",
        type=Path,
        metavar="FOLDER",
        help="run or campaign folder; or one that contains some",
    )
    flags.add_argument(
        "--table",
        choices=sorted(TABLES),
        metavar="NAME",
        help=f"of csv and parquet: {', '.join(sorted(TABLES))} (default: births)",
    )
    flags.add_argument(
        "--to",
        choices=(*_OF_TABLES, "latex", "phylogeny"),
        required=True,
        help="csv and parquet: a table with the columns experiment, repeat and seed; "
        "latex: the report's comparison of experiments; phylogeny: CSV of the ALife "
        "data standard",
    )
    flags.add_argument(
        "--out", type=Path, required=True, metavar="FILE", help="file to write"
    )
    return flags
