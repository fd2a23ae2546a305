"""Means over populations of the measures that an experiment names."""

import ast
from collections import defaultdict

import numpy as np
import pyarrow as pa

from analysis.measures.load import Run
from analysis.measures.population_table import Numbers, individual_ids, rows_of
from analysis.measures.run_tables import RunTables
from schema.experiment.bounded import read_bytes
from schema.limits import LONGEST_NAME, MOST_PLUGIN_BYTES, printable
from schema.plugins.kept import PLUGINS
from schema.plugins.source import PATH

_Row = tuple[int, int, str, float, int]
"""Island, births, measure, mean, number of robots."""


def named_measures(run: RunTables) -> pa.Table:
    """Return the mean of each measure over the judged robots of each population.

    Off-line each robot counts with its last evaluation on the island; on-line with each
    sample that was taken at that number of births while it was mature.

    Returns:
        One row per island, number of births and measure, with the columns of
        ``outputs.OUTPUTS["named_measures"]`` except the run's.
    """
    rows = sorted([*_off_line(run), *_on_line(run)])
    islands, births, measures, means, robots = zip(*rows, strict=True) if rows else (
        (), (), (), (), ()
    )  # fmt: skip
    return pa.table(
        {
            "island": pa.array(islands, pa.int32()),
            "births": pa.array(births, pa.int64()),
            "measure": pa.array(measures, pa.string()),
            "mean": pa.array(means, pa.float64()),
            "robots": pa.array(robots, pa.int64()),
        }
    )


def _off_line(run: RunTables) -> list[_Row]:
    evaluations, table = run.tables["evaluations"], run.population_table
    rows = rows_of(individual_ids(evaluations), run.births).tolist()
    islands = np.asarray(evaluations["island"], np.int64)
    # Each island judges a migrant by its own evaluation.
    count = 1 + max(islands.max(initial=0), table.islands.max(initial=0))
    values: dict[str, Numbers] = defaultdict(
        lambda: np.full((count, run.births.num_rows), np.nan)
    )
    measures = evaluations["measures"].to_pylist()
    for island, row, found in zip(islands.tolist(), rows, measures, strict=True):
        for name, value in found or ():
            if row >= 0:
                values[name][island, row] = value
    is_online = np.isin(table.islands, np.asarray(run.tables["fitness"]["island"]))
    places = zip(table.islands.tolist(), table.births.tolist(), strict=True)
    groups = [
        (number, *place) for number, place in enumerate(places) if not is_online[number]
    ]
    found_rows: list[_Row] = []
    for name, of_births in values.items():
        own = of_births[table.islands[table.group_of], table.members]
        judged = np.where(table.is_judged, own, np.nan)
        means, counts = table.mean(judged), table.sum(1.0 - np.isnan(judged))
        found_rows += [
            (island, births, name, float(means[number]), int(counts[number]))
            for number, island, births in groups
            if counts[number]
        ]
    return found_rows


def _on_line(run: RunTables) -> list[_Row]:
    samples = run.tables["fitness"]
    sums: dict[tuple[int, int, str], list[float]] = defaultdict(list)
    robots: dict[tuple[int, int, str], set[int]] = defaultdict(set)
    columns = ("island", "births", "is_mature", "measures")
    found = zip(
        *(samples[name].to_pylist() for name in columns),
        individual_ids(samples).tolist(),
        strict=True,
    )
    for island, births, is_mature, measures, robot in found:
        for name, value in (measures or ()) if is_mature else ():
            sums[island, births, name].append(value)
            robots[island, births, name].add(robot)
    return [
        (*key, float(np.mean(values)), len(robots[key])) for key, values in sums.items()
    ]


def with_docstrings(named: pa.Table, run: Run) -> pa.Table:
    """Return rows of ``named_measures`` with the column ``about``.

    Args:
        named: the rows.
        run: whose folder has the sources of its own measures; none is imported.
    """
    paths = filter(PATH.fullmatch, run.measures)
    own = {path.rpartition(":")[2]: _first_line(run, path) for path in paths}
    about = [own.get(name, "") for name in named["measure"].to_pylist()]
    return named.append_column("about", pa.array(about, pa.string()))


def _first_line(run: Run, path: str) -> str:
    """Return the first line of a function's docstring; empty if it is not known."""
    module, _, name = path.rpartition(":")
    file = run.folder.joinpath(PLUGINS, *module.split(".")).with_suffix(".py")
    try:
        found = ast.parse(read_bytes(file, MOST_PLUGIN_BYTES)).body
    except (OSError, ValueError, SyntaxError, RecursionError, MemoryError):
        return ""
    texts = [
        ast.get_docstring(each) or ""
        for each in found
        if isinstance(each, ast.FunctionDef) and each.name == name
    ]
    return printable("".join(texts).partition("\n")[0], LONGEST_NAME)
