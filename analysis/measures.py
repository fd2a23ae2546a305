"""What a run's tables say: pure functions from Arrow tables to Arrow tables."""

import pyarrow as pa
import pyarrow.compute as pc

from schema.errors import RunFolderError


def progression(population: pa.Table) -> pa.Table:
    """Return how fit populations are as births go by, over runs.

    A failed individual counts as fitness 0, as it does in selection. A run counts
    at every number of births that its own population was recorded at.

    Args:
        population: of several runs: ``experiment``, ``folder`` (which run),
            ``births``, ``fitness``.

    Returns:
        One row per experiment and births, ascending: ``experiment``, ``births``,
        ``mean`` over runs of the population's mean fitness, ``low`` and ``high``
        (the least and the greatest run), ``runs``.

    Raises:
        RunFolderError: no rows.

    Source: Hupkes 2016, figure 6.3; the spread is ours, the thesis omits it.
    """
    if not population.num_rows:
        raise RunFolderError("population: has no rows, nothing has been born")
    index = population.schema.get_field_index("fitness")
    fitness = pc.fill_null(population["fitness"], 0.0)
    keys = ["experiment", "births"]
    by_run = (
        population.set_column(index, "fitness", fitness)
        .group_by([*keys, "folder"])
        .aggregate([("fitness", "mean")])
    )
    totals = by_run.group_by(keys).aggregate(
        [
            ("fitness_mean", "mean"),
            ("fitness_mean", "min"),
            ("fitness_mean", "max"),
            ("fitness_mean", "count"),
        ]
    )
    named = totals.rename_columns([*keys, "mean", "low", "high", "runs"])
    return named.sort_by([(key, "ascending") for key in keys])
