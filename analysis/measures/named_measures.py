"""Means over populations of the measures that an experiment names."""

import ast

import numpy as np
import pyarrow as pa

from analysis.measures.load import LoadedRun
from analysis.measures.population_table import individual_ids, rows_of
from analysis.measures.run_tables import RunTables
from schema.limits import LONGEST_NAME, MOST_PLUGIN_BYTES, printable
from schema.plugins.bounded import read_bytes
from schema.plugins.kept import PLUGINS
from schema.plugins.source import PATH

_KEYS = ["island", "births", "measure"]


def named_measures(run: RunTables) -> pa.Table:
    """Return the mean of each measure over the judged robots of each population.

    Off-line each robot counts with its last evaluation on the island; on-line with each
    sample that was taken at that number of births while it was mature.
    """
    samples = run.tables["fitness"]
    mature = samples.filter(samples["is_mature"])
    on_line = _values(mature, run.births, {"births": mature["births"]})
    rows = pa.concat_tables(
        [_off_line(run), on_line.select([*_KEYS, "robot", "value"])]
    )
    means = rows.group_by(_KEYS, use_threads=False).aggregate(
        [("value", "mean"), ("robot", "count_distinct")]
    )
    return means.rename_columns([*_KEYS, "mean", "robots"]).sort_by(
        [(key, "ascending") for key in _KEYS]
    )


def _values(table: pa.Table, births: pa.Table, more: dict[str, object]) -> pa.Table:
    """Return one row per value of a named measure: island, robot, measure, value.

    ``robot`` is a row of births; ``more`` are further columns of the table.
    """
    lists = table["measures"].combine_chunks()
    offsets = np.asarray(lists.offsets)
    owners = np.repeat(np.arange(len(lists)), np.diff(offsets))
    start = int(offsets[0]) if len(offsets) else 0
    names, values = (
        each.slice(start, len(owners)) for each in (lists.keys, lists.items)
    )
    columns = {
        "island": table["island"].cast(pa.int32()),
        "robot": pa.array(rows_of(individual_ids(table), births)),
        **more,
    }
    rows = pa.table(columns).take(pa.array(owners))
    return rows.append_column("measure", names).append_column("value", values)


def _off_line(run: RunTables) -> pa.Table:
    table, evaluations = run.population_table, run.tables["evaluations"]
    keys = ["island", "robot", "measure"]
    values = _values(evaluations, run.births, {})
    # Each island judges a migrant by its own evaluation.
    last = values.group_by(keys, use_threads=False).aggregate([("value", "last")])
    is_online = np.isin(table.islands, np.asarray(run.tables["fitness"]["island"]))
    chosen = table.is_judged & ~is_online[table.group_of]
    groups = table.group_of[chosen]
    members = pa.table(
        {
            "island": pa.array(table.islands[groups], pa.int32()),
            "births": pa.array(table.births[groups], pa.int64()),
            "robot": pa.array(table.members[chosen], pa.int64()),
        }
    )
    found = members.join(last, keys[:2], join_type="inner")
    named = found.rename_columns({"value_last": "value"})
    return named.select([*_KEYS, "robot", "value"])


def with_docstrings(named: pa.Table, run: LoadedRun) -> pa.Table:
    """Return rows of ``named_measures`` with the column ``about``.

    The run's folder has the sources of its own measures; none is imported.
    """
    paths = filter(PATH.fullmatch, run.settings.measures.names)
    own = {path.rpartition(":")[2]: _first_line(run, path) for path in paths}
    about = [own.get(name, "") for name in named["measure"].to_pylist()]
    return named.append_column("about", pa.array(about, pa.string()))


def _first_line(run: LoadedRun, path: str) -> str:
    """Return the first line of a function's docstring; empty if it is not known."""
    module, _, name = path.rpartition(":")
    file = run.folder.joinpath(PLUGINS, *module.split(".")).with_suffix(".py")
    try:
        statements = ast.parse(read_bytes(file, MOST_PLUGIN_BYTES)).body
    except (OSError, ValueError, SyntaxError, RecursionError, MemoryError):
        return ""
    texts = [
        ast.get_docstring(statement) or ""
        for statement in statements
        if isinstance(statement, ast.FunctionDef) and statement.name == name
    ]
    return printable("".join(texts).partition("\n")[0], LONGEST_NAME)
