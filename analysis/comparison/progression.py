"""Means of measures over the runs of an experiment, by number of births."""

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from analysis.comparison.statistics import half_interval
from analysis.measures.outputs import POPULATION, schema


def progression(populations: pa.Table) -> pa.Table:
    """Return the means of measures over runs, by number of births.

    A run of several islands contributes their mean, at numbers of births at which all
    its islands have a value: islands are not recorded equally often. A run contributes
    at every number of births at which its own populations were recorded. There is no
    row where no run has a value.

    Source: Hupkes 2016, figures 6.3, 6.5 and 6.7; the intervals: own.
    """
    keys = ["experiment", "births"]
    pieces = []
    for measure in POPULATION:
        by_run = run_means(populations, measure)
        kinds = ("mean", "stddev", "min", "max", "count")
        totals = by_run.group_by(keys).aggregate([("mean", kind) for kind in kinds])
        names = [*keys, "mean", "sd", "least", "greatest", "runs"]
        named = totals.rename_columns(names).sort_by(
            [(key, "ascending") for key in keys]
        )
        measures = pa.repeat(pa.scalar(measure), named.num_rows)
        pieces.append(named.append_column("measure", measures))
    table = pa.concat_tables(pieces)
    mean = np.asarray(table["mean"], np.float64)
    deviation = np.asarray(table["sd"], np.float64)
    half = half_interval(deviation, np.asarray(table["runs"], np.int64))
    for name, ends in (("low", mean - half), ("high", mean + half)):
        table = table.append_column(name, pa.array(ends, from_pandas=True))
    return table.select(schema("progression").names).cast(schema("progression"))


def run_means(populations: pa.Table, measure: str) -> pa.Table:
    """Return a measure of each run by number of births, the mean over its islands.

    Rows are in ascending order, at births at which all islands of the run have a value.
    """
    keys = ["experiment", "folder", "births"]
    known = populations.filter(populations[measure].is_valid())
    means = known.group_by(keys).aggregate([(measure, "mean"), (measure, "count")])
    named = means.rename_columns([*keys, "mean", "islands"])
    most = named.group_by("folder").aggregate([("islands", "max")])
    whole = _with_count(named, "islands", "folder", most).drop_columns("islands")
    return whole.sort_by([(key, "ascending") for key in keys])


def mean_of_all_runs(progression: pa.Table, by_run: pa.Table) -> pa.Table:
    """Return the rows of a measure's progression at which every run has a value.

    A mean over other runs at other births would change without a change in any run.
    ``by_run`` are the measure's ``run_means``.
    """
    runs = by_run.group_by("experiment").aggregate([("folder", "count_distinct")])
    return _with_count(progression, "runs", "experiment", runs)


def _with_count(rows: pa.Table, count: str, key: str, wanted: pa.Table) -> pa.Table:
    """Return the rows whose count is that of their key in a table of both."""
    names, counts = (
        wanted[name].combine_chunks() for name in (key, wanted.column_names[-1])
    )
    own = pc.take(counts, pc.index_in(rows[key], names))
    return rows.filter(pc.fill_null(pc.equal(rows[count], own), fill_value=False))
