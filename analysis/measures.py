"""What a run's tables say: pure functions from Arrow tables to Arrow tables."""

import pyarrow as pa
import pyarrow.compute as pc

from schema.errors import RunFolderError


def _judged(population: pa.Table) -> pa.Table:
    """Return those whose fitness counts: off-line all, on-line the mature.

    Without a fitness is off-line who failed, and counts 0 as in selection; on-line
    it is who is not mature yet, and does not count.

    Raises:
        RunFolderError: no rows.
    """
    if not population.num_rows:
        raise RunFolderError("population: has no rows, nothing has been born")
    fitness = population["fitness"]
    filled = pc.if_else(population["is_online"], fitness, pc.fill_null(fitness, 0.0))
    index = population.schema.get_field_index("fitness")
    return population.set_column(index, "fitness", filled).filter(pc.is_valid(filled))


def progression(population: pa.Table) -> pa.Table:
    """Return how fit populations are as births go by, over runs.

    Off-line a failed individual counts as fitness 0, as it does in selection;
    on-line only the mature count. A run counts at every number of births that its
    own population was recorded at.

    Args:
        population: of several runs: ``experiment``, ``folder`` (which run),
            ``is_online``, ``births``, ``fitness``.

    Returns:
        One row per experiment and births, ascending: ``experiment``, ``births``,
        ``mean`` over runs of the population's mean fitness, ``low`` and ``high``
        (the least and the greatest run), ``runs``.

    Raises:
        RunFolderError: no rows.

    Source: Hupkes 2016, figure 6.3; the spread is ours, the thesis omits it.
    """
    keys = ["experiment", "births"]
    groups = _judged(population).group_by([*keys, "folder"])
    by_run = groups.aggregate([("fitness", "mean")])
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
        population: as for ``progression``, with the same meaning.

    Returns:
        One row per run, by experiment and folder: ``experiment``, ``folder``,
        ``births``, ``mean`` and ``best`` of the population, ``size``.

    Raises:
        RunFolderError: no rows.

    Source: Hupkes 2016, figure 6.2.
    """
    keys = ["experiment", "folder"]
    judged = _judged(population).select([*keys, "births", "fitness"])
    last = judged.group_by(keys).aggregate([("births", "max")])
    joined = judged.join(last, keys)
    rows = joined.filter(pc.equal(joined["births"], joined["births_max"]))
    totals = rows.group_by([*keys, "births"]).aggregate(
        [("fitness", "mean"), ("fitness", "max"), ("fitness", "count")]
    )
    named = totals.rename_columns([*keys, "births", "mean", "best", "size"])
    return named.sort_by([(key, "ascending") for key in keys])
