"""Measures over births, over the runs of an experiment."""

import numpy as np
import pyarrow as pa

from analysis.comparison.statistics import t_quantile
from analysis.measures.outputs import POPULATION, schema
from analysis.measures.population_table import Numbers
from analysis.measures.trees import Integers


def progression(populations: pa.Table) -> pa.Table:
    """Return how populations change as births go by, over runs.

    A run of several islands counts with their mean, at numbers of births that all of
    them have a value at: islands are not recorded equally often. A run counts at every
    number of births that its own populations were recorded at.

    Args:
        populations: of several runs, as ``outputs`` names its columns.

    Returns:
        One row per ``experiment``, ``measure`` (a column of ``populations``) and
        ``births``, ascending: ``mean`` over runs, ``low`` and ``high`` (the mean's
        95 % interval by Student's t; null of one run), ``least``, ``greatest``,
        ``runs``. Where no run has a value there is no row.

    Source: Hupkes 2016, figures 6.3, 6.5 and 6.7; the intervals are ours, the thesis
    omits them.
    """
    keys = ["experiment", "births"]
    pieces = []
    for measure in POPULATION:
        known = populations.filter(populations[measure].is_valid())
        by_run = _whole_runs(
            known.group_by([*keys, "folder"]).aggregate(
                [(measure, "mean"), (measure, "count")]
            ),
            f"{measure}_count",
        )
        totals = by_run.group_by(keys).aggregate(
            [
                (f"{measure}_mean", kind)
                for kind in ("mean", "stddev", "min", "max", "count")
            ]
        )
        named = totals.rename_columns(
            [*keys, "mean", "sd", "least", "greatest", "runs"]
        ).sort_by([(key, "ascending") for key in keys])
        measures = pa.repeat(pa.scalar(measure), named.num_rows)
        pieces.append(named.append_column("measure", measures))
    return _with_intervals(pa.concat_tables(pieces)).cast(schema("progression"))


def _whole_runs(by_run: pa.Table, count: str) -> pa.Table:
    """Return rows at which all islands of a run have a value."""
    islands = np.asarray(by_run[count], np.int64)
    folders = by_run["folder"].combine_chunks().dictionary_encode().indices
    runs = np.asarray(folders, np.int64)
    most = np.zeros(len(runs), np.int64)
    np.maximum.at(most, runs, islands)
    return by_run.filter(pa.array(islands == most[runs]))


def _with_intervals(table: pa.Table) -> pa.Table:
    runs = np.asarray(table["runs"], np.int64)
    mean = np.asarray(table["mean"], np.float64)
    # Arrow divides by the number of runs, an estimate by one less.
    spread = np.asarray(table["sd"], np.float64) / np.sqrt(np.maximum(runs - 1, 1))
    half = np.where(runs > 1, spread * _quantiles(runs), np.nan)
    ends = {"low": mean - half, "high": mean + half}
    for name, values in ends.items():
        table = table.append_column(name, pa.array(values, from_pandas=True))
    return table.select(schema("progression").names)


def _quantiles(runs: Integers) -> Numbers:
    different, where = np.unique(runs, return_inverse=True)
    found = [t_quantile(max(count - 1, 1)) for count in different.tolist()]
    return np.array(found, np.float64)[where]
