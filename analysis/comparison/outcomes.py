"""Outcomes of a run: one number per measure, by which experiments are compared."""

import math
from collections.abc import Mapping, Sequence

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from analysis.comparison.statistics import ranks
from analysis.measures.load import IslandSettings, island_settings
from analysis.measures.outputs import OWN, POPULATION
from analysis.measures.population_table import Numbers
from analysis.measures.populations import RETENTION_BIRTHS


def outcome(
    tables: Mapping[str, pa.Table], births: int, settings: Sequence[IslandSettings]
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
            founders = island_settings(island, settings).founders
            each.append(_of_island(columns, counts[rows], births, founders))
    found = {"births": float(births)}
    for name in each[0] if each else ():
        found[name] = _mean(np.array([one[name] for one in each]))
    going_on = np.unique(islands[counts > births]).tolist()
    if "robots" in tables:
        found |= _of_robots(tables["robots"], found, births)
        judged_again = [
            island
            for island in going_on
            if (own := island_settings(island, settings)).is_online or own.reevaluation
        ]
        judged = _without(tables["robots"], judged_again)
        found |= _correlations(judged.filter(pc.field("birth") < births))
    found |= _own_measures(tables, births)
    whole = {
        name: _without(tables[name], going_on)
        for name in ("families", "interactions", "variability")
        if name in tables
    }
    found |= _of_families(whole) | _of_contacts(whole)
    return found | _of_arena({**tables, **whole}, births)


def _without(table: pa.Table, islands: Sequence[int]) -> pa.Table:
    """Return the rows of other islands than these."""
    return table.filter(~pc.field("island").isin(islands))


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
        spacing: of the populations that count [births]: experiments that record one
            at each birth are treated as those that record one per brood.
    """

    def over_tenth(name: str, end: float) -> float:
        is_inside = (counts > end - births / 10) & (counts <= end)
        return _mean(columns[name][is_inside & (counts % spacing == 0)])

    rise = over_tenth("fitness", births) - over_tenth("fitness", births / 2)
    return {
        "late_rise": rise,
        "early_diversity": over_tenth("diversity", births / 10),
    }


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
    robots: pa.Table, last: dict[str, float], births: int
) -> dict[str, float]:
    is_random = pc.field("ancestors") == 0
    random = robots.filter((pc.field("birth") < births) & is_random)
    found = {}
    for name in ("parts", "touch_sensors", "hidden"):
        change = last.get(name, math.nan) - _mean(_column(random, name))
        found[f"{name}_change"] = change
    return found


def _correlations(robots: pa.Table) -> dict[str, float]:
    fitness = _column(robots, "fitness")
    return {
        f"{name}_fitness": _correlation(_column(robots, name), fitness)
        for name in ("parts", "extremities", "extremities_per_part")
    }


def _own_measures(tables: Mapping[str, pa.Table], births: int) -> dict[str, float]:
    if "named_measures" not in tables:
        return {}
    last: dict[tuple[str, int], float] = {}
    rows = tables["named_measures"].filter(pc.field("births") <= births)
    for row in rows.sort_by("births").to_pylist():
        last[row["measure"], row["island"]] = row["mean"]
    each: dict[str, list[float]] = {}
    for (name, _), mean in last.items():
        each.setdefault(f"{OWN}{name}", []).append(mean)
    return {name: _mean(np.array(means)) for name, means in each.items()}


def _of_families(tables: Mapping[str, pa.Table]) -> dict[str, float]:
    found = dict.fromkeys(("family_distance", "family_founders"), math.nan)
    if "families" in tables:
        families = tables["families"]
        distance, apart = (
            _column(families, name) for name in ("distance", "founder_distance")
        )
        unknown = np.full(len(apart), np.nan)
        ratio = np.divide(distance, apart, out=unknown, where=apart > 0)
        found["family_distance"] = _mean(ratio)
        found["family_founders"] = _mean(_column(families, "founders"))
    return found


def _of_arena(tables: Mapping[str, pa.Table], births: int) -> dict[str, float]:
    names = ("variability", "between", "real_time_factor")
    found = dict.fromkeys(names, math.nan)
    if "variability" in tables:
        born = tables["variability"].filter(pc.field("birth") < births)
        values = _column(born, "variability")
        values = values[~np.isnan(values)]
        found["variability"] = float(np.median(values)) if len(values) else math.nan
    if "between" in tables:
        until = tables["between"].filter(pc.field("births") <= births)
        if until.num_rows:
            found["between"] = float(_column(until, "between")[-1])
    return found


def _of_contacts(tables: Mapping[str, pa.Table]) -> dict[str, float]:
    found = dict.fromkeys(("touched", "touching"), math.nan)
    if "interactions" in tables:
        for name in found:
            found[name] = _mean(_column(tables["interactions"], name))
    return found


def _correlation(first: Numbers, second: Numbers) -> float:
    """Return Spearman's rank correlation of pairs; NaN if one of the two is constant.

    Pairs with a NaN are ignored.
    """
    is_known = ~np.isnan(first) & ~np.isnan(second)
    first, second = first[is_known], second[is_known]
    if len(first) < 2 or not np.ptp(first) or not np.ptp(second):  # noqa: PLR2004
        return math.nan
    return float(np.corrcoef(ranks(first), ranks(second))[0, 1])


def _column(table: pa.Table, name: str) -> Numbers:
    return np.asarray(table[name].to_numpy(), np.float64)


def _mean(values: Numbers) -> float:
    known = values[~np.isnan(values)]
    return float(known.mean()) if len(known) else math.nan
