"""Fitness and measures of the robots of a run, in the order of births."""

from collections.abc import Sequence

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from analysis.measures.population_table import Numbers, individual_ids, rows_of


def samples(
    evaluations: pa.Table, fitness: pa.Table, births: pa.Table, names: Sequence[str]
) -> pa.Table:
    """Return fitness and named measures of robots on their islands of birth.

    Off-line they are those of the evaluation at birth, in arenas those of the first
    sample of the mature robot. Failed evaluations are left out.

    Returns:
        ``island``, ``births`` on it so far, ``robot`` (row of births), ``fitness`` and
        a column per measure, by island and births.
    """
    first = evaluations.filter(pc.field("trial") == 0)
    born = pc.add(first["birth"].cast(pa.int64()), 1)
    mature = fitness.filter(pc.field("is_mature"))
    rows = pa.concat_tables(
        pa.table(
            {
                "island": table["island"].cast(pa.int64()),
                "births": so_far.cast(pa.int64()),
                "robot": pa.array(rows_of(individual_ids(table), births)),
                "home": table["birth_island"].cast(pa.int64()),
                "fitness": table["fitness"],
                **{
                    name: pc.map_lookup(table["measures"], pa.scalar(name), "first")
                    for name in names
                },
            }
        )
        for table, so_far in ((first, born), (mature, mature["births"]))
    ).drop_null()
    is_native = (pc.field("island") == pc.field("home")) & (pc.field("robot") >= 0)
    native = rows.filter(is_native).sort_by(
        [(key, "ascending") for key in ("island", "births")]
    )
    _, earliest = np.unique(native["robot"].to_numpy(), return_index=True)
    return native.take(np.sort(earliest)).drop_columns("home")


def numbers(rows: pa.Table, names: Sequence[str]) -> Numbers:
    """Return columns of a table, (N, M)."""
    columns = [np.asarray(rows[name].to_numpy(), np.float64) for name in names]
    return np.stack(columns, axis=1)
