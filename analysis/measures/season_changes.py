"""What populations lose at each point of ``[[changes]]``, and when they recover."""

from itertools import pairwise
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from analysis.measures.load import island_settings
from analysis.measures.outputs import run_schema
from analysis.measures.population_table import Numbers
from analysis.measures.run_tables import RunTables
from schema.experiment.changes import change_points
from schema.experiment.document import Experiment


def season_changes(run: RunTables) -> pa.Table:
    """Return each point of the changes of each island, up to its end in the run."""
    rows = [
        row
        for island in pc.unique(run.births["island"]).to_pylist()
        for row in _of_island(run, island, island_settings(island, run.islands))
    ]
    return pa.Table.from_pylist(rows, run_schema("changes"))


def _of_island(
    run: RunTables, island: int, settings: Experiment
) -> list[dict[str, Any]]:
    points, means = _course(run, island, is_arena=settings.arena is not None)
    if not len(points) or not settings.changes:
        return []
    end, clock = float(points[-1]), settings.simulation
    changed: dict[float, list[str]] = {}
    for change in settings.changes:
        for point in change_points(change, end):
            changed.setdefault(point, []).append(change.setting)
    # In an arena, all samples of a window must be of the time after the point.
    window = clock.window_steps * clock.timestep_s if settings.arena else 0.0
    births = run.births.filter(pc.equal(run.births["island"], island))
    rows = []
    for point, following in pairwise([*sorted(changed), end]):
        row = _row(points, means, (point, following), window)
        if settings.arena:
            born = pc.sum(pc.less_equal(births["sim_time_s"], point)).as_py()
        else:
            born = round(point)
        names = ", ".join(changed[point])
        about = {"island": island, "births": born, "setting": names, "point": point}
        rows.append(about | row)
    return rows


def _row(
    points: Numbers, means: Numbers, span: tuple[float, float], window: float
) -> dict[str, float | None]:
    """Return what happens to the mean fitness between one change and the next.

    ``points`` ascend; the mean fitness of populations at each is (P,).
    """
    start, end = span
    earlier = means[points <= start]
    is_later = (points > start) & (points >= start + window) & (points <= end)
    later, times = means[is_later], points[is_later]
    if not (len(earlier) and len(later)):
        return {}
    before, after = float(earlier[-1]), float(later[0])
    back = np.flatnonzero(later >= before)
    recovery = float(times[back[0]]) - start if len(back) else None
    return {
        "before": before, "after": after, "lost": before - after, "recovery": recovery
    }  # fmt: skip


def _course(run: RunTables, island: int, *, is_arena: bool) -> tuple[Numbers, Numbers]:
    """Return points and mean fitness of an island's populations, (P,) each.

    In an arena those of the samples of fitness, of its mature robots.
    """
    if not is_arena:
        table = run.population_table
        here, means = table.islands == island, table.mean(table.fitness)
        points = table.births.astype(np.float64)
        here &= ~np.isnan(means)
        return points[here], means[here]
    samples = run.tables["fitness"]
    is_judged = pc.and_(pc.equal(samples["island"], island), samples["is_mature"])
    grouped = samples.filter(is_judged).group_by("sim_time_s", use_threads=False)
    course = grouped.aggregate([("fitness", "mean")]).sort_by("sim_time_s")
    times, means = course["sim_time_s"].to_numpy(), course["fitness_mean"].to_numpy()
    return times, means
