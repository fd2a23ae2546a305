"""Outcomes of a run: one number per measure, by which experiments are compared."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
from scipy import stats

from analysis.measures.load import island_settings
from analysis.measures.outputs import OWN, POPULATION, schema
from analysis.measures.population_table import Numbers, ratio
from analysis.measures.populations import RETENTION_BIRTHS
from analysis.measures.winners import LATER
from schema.experiment.document import Experiment

BORN_BY_COUNT = (pc.field("by") == "count") & (pc.field("population") == "born")
"""Rows of ``extremities`` about all robots, by their number."""
MANY = 4
"""Extremities from which on fitness is flat, says the thesis of figure 6.14a."""


def outcome(
    tables: Mapping[str, pa.Table], births: int, settings: Sequence[Experiment]
) -> dict[str, float]:
    """Return the outcomes of a run at a number of births.

    No outcome depends on what happened after these births. Contacts, families,
    variability, and the fitness of robots that are judged again while they live are
    known for whole lives only: they are those of the islands that end by then.

    Args:
        tables: tables of one run, with the columns of ``outputs``.
        births: births on each island; the last population at or before is used.
        settings: of each island.

    Returns:
        Numbers by the names of ``outputs.OUTCOME``, the mean over several islands;
        NaN where a measure has no value. Measures that the experiment names follow
        ``outputs.OWN``; one without a value is missing.
    """
    populations = tables["populations"]
    islands = np.asarray(populations["island"], np.int64)
    counts = _column(populations, "births")
    each = []
    for island in np.unique(islands).tolist():
        rows = np.flatnonzero((islands == island) & (counts <= births))
        if len(rows):
            columns = {name: _column(populations, name)[rows] for name in POPULATION}
            founders = island_settings(island, settings).selection.population
            each.append(_of_island(columns, counts[rows], births, founders))
    found = {"births": float(births)}
    for name in each[0] if each else ():
        found[name] = _mean(np.array([one[name] for one in each]))
    going_on = np.unique(islands[counts > births]).tolist()
    judged_again = [
        island
        for island in going_on
        if (own := island_settings(island, settings)).arena
        or own.selection.reevaluation
    ]
    found |= _of_robots(tables, found, births, judged_again)
    return found | _own_measures(tables, births) | _of_lives(tables, births, going_on)


def _table(
    tables: Mapping[str, pa.Table], name: str, without: Sequence[int] = ()
) -> pa.Table:
    """Return a table, which may be missing, without the rows of some islands."""
    rows = tables.get(name)
    if rows is None:
        return schema(name).empty_table()
    return rows.filter(~pc.field("island").isin(without)) if without else rows


def _of_island(
    columns: dict[str, Numbers], counts: Numbers, births: int, founders: int
) -> dict[str, float]:
    found = {name: float(values[-1]) for name, values in columns.items()}
    is_past = counts + RETENTION_BIRTHS <= births
    retention = np.where(is_past, columns["retention"], np.nan)
    found["retention"] = _mean(retention)
    found["late_gain"] = _share(columns["fitness"], counts, births / 2, is_late=True)
    first = int(np.searchsorted(counts, min(founders, counts[-1])))
    diversity = columns["diversity"][first:]
    drop = _share(diversity, counts[first:], births / 10, is_late=False)
    found["early_drop"] = drop
    found["diversity_change"] = float(diversity[-1] - diversity[0])
    found["gain"] = float(columns["fitness"][-1] - columns["fitness"][first])
    found["size_mean"] = _mean(columns["size"])
    found["retention_fitness"] = _correlation(retention, columns["fitness"])
    return found | of_courses(columns, counts, births, founders)


def of_courses(
    columns: Mapping[str, Numbers], counts: Numbers, births: int, spacing: int
) -> dict[str, float]:
    """Return the outcomes that are means over a part of an island's populations.

    Args:
        columns: ``fitness`` and ``diversity`` of its P populations, (P,) each.
        counts: (P,) births at each of them, ascending.
        births: at which the run is judged.
        spacing: of the populations that count [births], so that experiments that record
            one at each birth are treated as those that record one per brood.
    """

    def over_tenth(name: str, end: float) -> float:
        is_inside = (counts > end - births / 10) & (counts <= end)
        return _mean(columns[name][is_inside & (counts % spacing == 0)])

    rise = over_tenth("fitness", births) - over_tenth("fitness", births / 2)
    return {"late_rise": rise, "early_diversity": over_tenth("diversity", births / 10)}


def _share(values: Numbers, counts: Numbers, middle: float, *, is_late: bool) -> float:
    """Return the share of a change that happened before or after ``middle``.

    ``is_late`` selects the share after it, of an increase; otherwise the share before
    it, of a decrease. NaN without such an increase or decrease, and if nothing between
    the first value and ``middle`` is recorded: the share would be 1 or 0 in any case.
    """
    known = ~np.isnan(values)
    values, counts = values[known], counts[known]
    if not len(values):
        return math.nan
    until = int(np.searchsorted(counts, middle, side="right")) - 1
    change = values[-1] - values[0]
    if until <= 0 or (change <= 0 if is_late else change >= 0):
        return math.nan
    part = values[-1] - values[until] if is_late else values[until] - values[0]
    return float(part / change)


def _of_robots(
    tables: Mapping[str, pa.Table],
    last: Mapping[str, float],
    births: int,
    judged_again: Sequence[int],
) -> dict[str, float]:
    """Return changes from random robots, and correlations with fitness."""
    is_born = pc.field("birth") < births
    born = _table(tables, "robots").filter(is_born)
    random = born.filter(pc.field("ancestors") == 0)
    judged = _table(tables, "robots", judged_again).filter(is_born)
    fitness = _column(judged, "fitness")
    return {
        f"{name}_change": last.get(name, math.nan) - _mean(_column(random, name))
        for name in ("parts", "touch_sensors", "hidden")
    } | {
        f"{name}_fitness": _correlation(_column(judged, name), fitness)
        for name in ("parts", "extremities", "extremities_per_part")
    }


def slope(extremities: Numbers, fitness: Numbers, robots: Numbers) -> float:
    """Return the change of fitness per extremity from ``MANY`` on.

    Args:
        extremities: (N,) of each bin.
        fitness: (N,) mean of its robots.
        robots: (N,) number of its robots.

    Returns:
        Slope of the least squares over robots; NaN for less than two such bins.
    """
    is_many = (extremities >= MANY) & ~np.isnan(fitness)
    x, y, counts = extremities[is_many], fitness[is_many], robots[is_many]
    if len(x) < 2:  # noqa: PLR2004
        return math.nan
    away = x - np.average(x, weights=counts)
    return float((counts * away * y).sum() / (counts * away**2).sum())


def _own_measures(tables: Mapping[str, pa.Table], births: int) -> dict[str, float]:
    last: dict[tuple[str, int], float] = {}
    rows = _table(tables, "named_measures").filter(pc.field("births") <= births)
    for row in rows.sort_by("births").to_pylist():
        last[row["measure"], row["island"]] = row["mean"]
    each: dict[str, list[float]] = {}
    for (name, _), mean in last.items():
        each.setdefault(f"{OWN}{name}", []).append(mean)
    return {name: _mean(np.array(means)) for name, means in each.items()}


def _of_lives(
    tables: Mapping[str, pa.Table], births: int, going_on: Sequence[int]
) -> dict[str, float]:
    """Return outcomes of lives and of the best robot, of islands that have ended."""
    families, contacts, lives, robots = (
        _table(tables, name, going_on)
        for name in ("families", "interactions", "variability", "robots")
    )
    distances = (_column(families, name) for name in ("distance", "founder_distance"))
    ranges = _column(lives.filter(pc.field("birth") < births), "variability")
    ranges = ranges[~np.isnan(ranges)]
    bins = _table(tables, "extremities").filter(BORN_BY_COUNT)
    many = (_column(bins, name) for name in ("bin", "fitness", "robots"))
    until = _table(tables, "between").filter(pc.field("births") <= births)
    between = _column(until, "between")
    return {
        "family_distance": _mean(ratio(*distances)),
        "family_founders": _mean(_column(families, "founders")),
        **{name: _mean(_column(robots, name)) for name in LATER},
        "variability": float(np.median(ranges)) if len(ranges) else math.nan,
        "between": float(between[-1]) if len(between) else math.nan,
        "extremities_slope": math.nan if going_on else slope(*many),
        "kept_fitness": math.nan,
        "real_time_factor": math.nan,
        "touched": _mean(_column(contacts, "touched")),
        "touching": _mean(_column(contacts, "touching")),
    }


def _correlation(first: Numbers, second: Numbers) -> float:
    """Return Spearman's rank correlation of pairs; NaN if one of the two is constant.

    Pairs with a NaN are ignored.
    """
    is_known = ~np.isnan(first) & ~np.isnan(second)
    first, second = first[is_known], second[is_known]
    if len(first) < 2 or not np.ptp(first) or not np.ptp(second):  # noqa: PLR2004
        return math.nan
    first, second = stats.rankdata(first), stats.rankdata(second)
    return float(np.corrcoef(first, second)[0, 1])


def _column(table: pa.Table, name: str) -> Numbers:
    return np.asarray(table[name].to_numpy(), np.float64)


def _mean(values: Numbers) -> float:
    known = values[~np.isnan(values)]
    return float(known.mean()) if len(known) else math.nan
