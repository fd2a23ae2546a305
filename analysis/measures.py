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


def final_fitness(population: pa.Table) -> pa.Table:
    """Return how fit each run's last recorded population is.

    Args:
        population: of several runs: ``experiment``, ``folder``, ``births``,
            ``fitness``; a failed individual counts as fitness 0.

    Returns:
        One row per run, by experiment and folder: ``experiment``, ``folder``,
        ``births``, ``mean`` and ``best`` of the population, ``size``.

    Raises:
        RunFolderError: no rows.

    Source: Hupkes 2016, figure 6.2.
    """
    if not population.num_rows:
        raise RunFolderError("population: has no rows, nothing has been born")
    keys = ["experiment", "folder"]
    last = population.group_by(keys).aggregate([("births", "max")])
    joined = population.select([*keys, "births", "fitness"]).join(last, keys)
    rows = joined.filter(pc.equal(joined["births"], joined["births_max"]))
    index = rows.schema.get_field_index("fitness")
    rows = rows.set_column(index, "fitness", pc.fill_null(rows["fitness"], 0.0))
    totals = rows.group_by([*keys, "births"]).aggregate(
        [("fitness", "mean"), ("fitness", "max"), ("fitness", "count")]
    )
    named = totals.rename_columns([*keys, "births", "mean", "best", "size"])
    return named.sort_by([(key, "ascending") for key in keys])
