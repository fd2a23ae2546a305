"""Rows of a finished run that docs/data keeps."""

from collections.abc import Mapping

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from analysis.comparison.outcomes import outcome
from analysis.measures.families import family
from analysis.measures.load import LoadedRun
from analysis.measures.study import measure_run, reach
from docs.studies.thesis.data import SPACING, TABLES
from schema.errors import RunFolderError
from schema.tables.files import read_table

MARKS = (600,)
"""Births at which outcomes are kept, besides the last."""

_PLATFORMS = (
    ("runs", "platform"),
    ("evaluations", "platform"),
    ("drifts", "before"),
    ("drifts", "after"),
)
"""Columns that name the platforms of a run."""


def measured_rows(one: LoadedRun, commit: str | None) -> dict[str, pa.Table]:
    """Return the rows of a finished run by table, in the order of ``TABLES``.

    Raises:
        RunFolderError: a table of the run cannot be read or measured.
    """
    measured = measure_run(one, "parent")
    # Arenas of the thesis do not record touches.
    incomplete = [each for each in measured.left_out if each.what != "interactions"]
    if incomplete:
        raise RunFolderError(f"{incomplete[0].what}: {incomplete[0].why}")
    last = reach(measured)
    marks = sorted({last, *(births for births in MARKS if births < last)})
    outcomes = [outcome(measured.tables, births, one.islands) for births in marks]
    births = read_table(one.folder, "births")
    found = {
        **measured.tables,
        "outcomes": pa.Table.from_pylist(outcomes),
        "populations": _thinned(measured.tables["populations"]),
        "final": _final(measured.tables["robots"], births),
        "family": _family(measured.tables, births),
        "runs": _details(one, commit, births.num_rows),
    }
    return {name: _kept(found[name], name, one) for name in TABLES if name in found}


def _thinned(populations: pa.Table) -> pa.Table:
    """Return the populations at multiples of ``SPACING`` births, and the last one."""
    births = np.asarray(populations["births"], np.int64)
    return populations.filter(
        pa.array((births % SPACING == 0) | (births == births[-1]))
    )


def _final(robots: pa.Table, births: pa.Table) -> pa.Table:
    """Return the robots of the last population with parents and genomes."""
    rows = robots.filter(robots["is_last"])
    born = births.take(pc.index_in(rows["birth"], births["birth"].combine_chunks()))
    parents = [
        [parent["birth"] for parent in couple] for couple in born["parents"].to_pylist()
    ]
    rows = rows.append_column("parents", pa.array(parents, pa.list_(pa.int64())))
    return rows.append_column("genome", born["genome"])


def _family(measured: Mapping[str, pa.Table], births: pa.Table) -> pa.Table:
    """Return the family of the best robot, and the founders of its parts.

    ``level`` is 0 for the robot, 1 for its parents and so on, and null for founders on
    no level. Founders are last, the one with the most parts first.
    """
    best = measured["families"]["birth"][0].as_py()
    numbers = births["birth"].to_pylist()
    found = family(births, numbers.index(best))
    levels = {row: level for level, rows in enumerate(found.levels) for row in rows}
    rows = [row for row in levels if row not in found.founders] + [*found.founders]
    chosen = births.take(pa.array(rows))
    robots = measured["robots"]
    fitness = dict(
        zip(robots["birth"].to_pylist(), robots["fitness"].to_pylist(), strict=True)
    )
    parents = [
        [one["birth"] for one in couple] for couple in chosen["parents"].to_pylist()
    ]
    return pa.table(
        {
            "birth": chosen["birth"],
            "level": pa.array([levels.get(row) for row in rows], pa.int64()),
            "parents": pa.array(parents, pa.list_(pa.int64())),
            "rank": chosen["rank"],
            "fitness": pa.array(
                [fitness.get(numbers[row]) for row in rows], pa.float64()
            ),
            "genome": chosen["genome"],
        }
    )


def _details(one: LoadedRun, commit: str | None, births: int) -> pa.Table:
    """Return the description of a run with its platforms and commit."""
    platforms: set[str] = set()
    for table, column in _PLATFORMS:
        platforms.update(read_table(one.folder, table)[column].to_pylist())
    runs = read_table(one.folder, "runs")
    if not runs.num_rows:
        raise RunFolderError(f"{one.folder}: the table runs has no row")
    row = {
        "seed": one.seed,
        "births": births,
        "state": one.state,
        "platform": " ".join(sorted(platforms)),
        "versions": runs["versions"][0].as_py(),
        "commit": commit,
        "document": one.document,
    }
    return pa.Table.from_pylist([row], TABLES["runs"])


def _kept(table: pa.Table, name: str, one: LoadedRun) -> pa.Table:
    """Return a table with the columns that are kept; NaN becomes null."""
    columns = {"experiment": one.experiment, "run": one.number}
    arrays = []
    for field in TABLES[name]:
        if field.name in columns:
            value = pa.scalar(columns[field.name], field.type)
            arrays.append(pa.repeat(value, table.num_rows))
            continue
        array = table[field.name].combine_chunks()
        if pa.types.is_floating(array.type):
            array = pc.if_else(pc.is_nan(array), None, array)
        arrays.append(array.cast(field.type))
    return pa.Table.from_arrays(arrays, schema=TABLES[name])
