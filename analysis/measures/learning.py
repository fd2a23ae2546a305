"""What newborns gain by lifetime learning, and which bodies it saves."""

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from analysis.measures.population_table import Numbers, individual_ids, rows_of
from analysis.measures.run_tables import RunTables
from schema.robot.trees import Integers

_QUARTILES = (0.25, 0.5, 0.75)


def _trials(run: RunTables) -> tuple[Numbers, Integers]:
    """Return the best fitness after each trial, and the births row of each robot.

    Returns:
        (R, T) with a failed trial as 0, or the least fitness below 0, if none before
        succeeded, NaN behind a robot's last trial; and (R,) rows.
    """
    table = run.tables["learning"].sort_by(
        [("island", "ascending"), ("birth", "ascending"), ("trial", "ascending")]
    )
    rows = rows_of(individual_ids(table, "island"), run.births)
    table, rows = table.filter(pa.array(rows >= 0)), rows[rows >= 0]
    trials = np.asarray(table["trial"].to_numpy(), np.int64)
    robots, places = np.unique(rows, return_inverse=True)
    best: Numbers = np.full((len(robots), trials.max(initial=-1) + 1), np.nan)
    best[places, trials] = np.asarray(table["fitness"].to_numpy(), np.float64)
    tried = np.zeros(best.shape, np.bool_)
    tried[places, trials] = True
    best = np.fmax.accumulate(best, axis=1)
    least = np.nanmin(best, initial=0.0)
    best = np.where(tried, np.nan_to_num(best, nan=least), np.nan)
    return best, robots


def learning(run: RunTables) -> pa.Table:
    """Return each newborn that has learnt."""
    best, robots = _trials(run)
    tried = (~np.isnan(best)).sum(axis=1)
    at_birth = best[:, 0] if best.size else np.empty(0)
    reached = best[np.arange(len(best)), tried - 1] if best.size else np.empty(0)
    kept, saved = _selected(run, robots, at_birth)
    births = run.births.take(robots)
    return pa.table(
        {
            "birth_island": births["island"],
            "birth": births["birth"],
            "trials": tried,
            "at_birth": at_birth,
            "fitness": reached,
            "gain": reached - at_birth,
            "kept": kept,
            "saved": saved,
        }
    )


def _selected(
    run: RunTables, robots: Integers, at_birth: Numbers
) -> tuple[pa.Array, pa.Array]:
    """Return which robots were kept, and which of them learning saved.

    Both are null in these cases. Off-line: the robot was born before the island's first
    recorded population, or no population was recorded after its brood. In an arena: the
    run ended before the robot was in two recorded populations as a mature robot, or the
    robot migrated or was removed by an operator.
    """
    before = np.full(run.births.num_rows, np.nan)
    before[robots] = at_birth
    kept: dict[int, bool] = {}
    saved: dict[int, bool] = {}
    islands = np.asarray(run.births["island"].to_numpy(), np.int64)
    numbers = np.asarray(run.births["birth"].to_numpy(), np.int64)
    is_online = np.asarray(run.births["sim_time_s"].is_valid())
    past: dict[int, int] = {}
    matured: set[int] = set()
    table = run.population_table
    for group, own in enumerate(table.living):
        members, fitness = table.members[own], table.fitness[own]
        island = int(table.islands[group])
        first = past.get(island)
        past[island] = births = int(table.births[group])
        judged = {*members[~np.isnan(fitness)].tolist()}
        least = np.nanmin(fitness, initial=np.inf)
        is_own = islands == island
        if is_online[is_own].any():
            new = [row for row in judged & matured if row not in kept and is_own[row]]
            matured |= judged
        elif first is not None:
            is_new = is_own & (numbers >= first) & (numbers < births)
            new = np.flatnonzero(is_new).tolist()
        else:
            continue
        for row in new:
            kept[row] = row in judged
            saved[row] = row in judged and bool(before[row] < least)
    for row in _culled(run):
        kept.setdefault(row, False)
        saved.setdefault(row, False)
    chosen = robots.tolist()
    return (
        pa.array([kept.get(row) for row in chosen], pa.bool_()),
        pa.array([saved.get(row) for row in chosen], pa.bool_()),
    )


def _culled(run: RunTables) -> list[int]:
    """Return the births rows of robots that died where they were born."""
    deaths = run.tables["deaths"]
    reasons = pa.array(["migrated", "removed"])
    died = deaths.filter(
        pc.and_(
            pc.invert(pc.is_in(deaths["reason"], reasons)),
            pc.equal(deaths["birth_island"], deaths["island"]),
        )
    )
    rows = rows_of(individual_ids(died), run.births)
    return [row for row in rows.tolist() if row >= 0]


def learning_curves(run: RunTables) -> pa.Table:
    """Return quartiles over robots of the best fitness after each trial."""
    best, _ = _trials(run)
    count = best.shape[1]
    low, median, high = (
        np.nanquantile(best, _QUARTILES, axis=0) if count else np.empty((3, 0))
    )
    return pa.table(
        {
            "trial": np.arange(count),
            "robots": (~np.isnan(best)).sum(axis=0),
            "median": median,
            "low": low,
            "high": high,
        }
    )
