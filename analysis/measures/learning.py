"""What newborns gain by lifetime learning, and which bodies it saves."""

import numpy as np
import pyarrow as pa

from analysis.measures.population_table import Numbers, individual_ids, rows_of
from analysis.measures.run_tables import RunTables
from analysis.measures.trees import Integers

_QUARTILES = (0.25, 0.5, 0.75)


def _trials(run: RunTables) -> tuple[Numbers, Integers]:
    """Return the best fitness after each trial, and the births row of each robot.

    Returns:
        (R, T) with a failed trial as 0 if none before succeeded, NaN behind a robot's
        last trial; and (R,) rows.
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
    best = np.where(tried, np.nan_to_num(best, nan=0.0), np.nan)
    return best, robots


def learning(run: RunTables) -> pa.Table:
    """Return each newborn that has learnt.

    Returns:
        One row per robot, with the columns of ``outputs.OUTPUTS["learning"]`` except
        the run's.
    """
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

    Both are null for robots that were born before the island's first recorded
    population, and of a brood that is not recorded.
    """
    table = run.population_table
    islands = np.asarray(run.births["island"].to_numpy(), np.int64)
    numbers = np.asarray(run.births["birth"].to_numpy(), np.int64)
    before = np.full(run.births.num_rows, np.nan)
    before[robots] = at_birth
    kept: list[bool | None] = [None] * len(before)
    saved: list[bool | None] = [None] * len(before)
    past: dict[int, int] = {}
    for group, (island, births) in enumerate(
        zip(table.islands.tolist(), table.births.tolist(), strict=True)
    ):
        first = past.get(island)
        past[island] = births
        if first is None:
            continue
        own = slice(table.starts[group], table.starts[group + 1])
        members = set(table.members[own].tolist())
        least = np.nanmin(table.fitness[own], initial=np.inf)
        is_new = (islands == island) & (numbers >= first) & (numbers < births)
        for row in np.flatnonzero(is_new).tolist():
            kept[row] = row in members
            saved[row] = row in members and bool(before[row] < least)
    chosen = robots.tolist()
    return (
        pa.array([kept[row] for row in chosen], pa.bool_()),
        pa.array([saved[row] for row in chosen], pa.bool_()),
    )


def learning_curves(run: RunTables) -> pa.Table:
    """Return quartiles over robots of the best fitness after each trial.

    Returns:
        One row per trial, with the columns of ``outputs.OUTPUTS["learning_curves"]``
        except the run's.
    """
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
