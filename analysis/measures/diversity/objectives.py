"""Births of experiments with several objectives, their Pareto fronts and volumes."""

from collections.abc import Mapping

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from analysis.measures.diversity.samples import numbers, samples
from analysis.measures.outputs import run_schema
from analysis.measures.population_table import Numbers
from analysis.measures.run_tables import RunTables
from schema.experiment.document import Experiment


def objectives_of(island: Experiment) -> Mapping[str, str]:
    """Return the objectives of ``nsga2``, "max" or "min" by name; empty without it."""
    own = island.selection
    rules = {
        own.parents: own.parents_parameters,
        own.survivors: own.survivors_parameters,
    }
    objectives: Mapping[str, str] = rules.get("nsga2", {}).get("objectives", {})
    return objectives


def fronts(run: RunTables) -> pa.Table:
    """Return the first two objectives of all births, and which are on the front.

    The front is that of all births of an island in all of its objectives.
    """
    schema, rows = run_schema("fronts"), []
    evaluations, fitness = (run.tables[name] for name in ("evaluations", "fitness"))
    for island, settings in enumerate(run.islands):
        objectives = objectives_of(settings)
        names = [name for name in objectives if name != "fitness"]
        born = samples(evaluations, fitness, run.births, names)
        mine = born.filter(pc.field("island") == island)
        if not objectives or not mine.num_rows:
            continue
        values = numbers(mine, [*objectives])
        signs = [1.0 if sense == "max" else -1.0 for sense in objectives.values()]
        best = {tuple(point) for point in front(values * signs).tolist()}
        x_text, y_text, *_ = (f"{name} ({sense})" for name, sense in objectives.items())
        births = run.births.take(mine["robot"])["birth"].to_pylist()
        for birth, own in zip(births, values, strict=True):
            is_best = tuple((own * signs).tolist()) in best
            row = (island, island, birth, x_text, y_text, own[0], own[1], is_best)
            rows.append(dict(zip(schema.names, row, strict=True)))
    return pa.Table.from_pylist(rows, schema)


def front(points: Numbers) -> Numbers:
    """Return the points that no other one dominates, (F, M) of (N, M), sorted.

    A point dominates another one if it is at least as great in each objective, and
    greater in one. Of equal points there is one.
    """
    different = np.unique(points, axis=0)
    is_kept = np.zeros(len(different), np.bool_)
    # A point comes after all points that it may dominate.
    for at in range(len(different) - 1, -1, -1):
        rivals = different[at + 1 :][is_kept[at + 1 :]]
        is_kept[at] = not (rivals >= different[at]).all(axis=1).any()
    kept: Numbers = different[is_kept]
    return kept


def hypervolume(points: Numbers) -> float:
    """Return the volume that points, (N, M), all >= 0, dominate from 0 on.

    It is cut into slices of the first objective.

    Source: Zitzler 2001, "Hypervolume metric calculation" (hypervolume by slicing
    objectives).
    """
    if points.shape[1] == 1:
        return float(points.max(initial=0.0))
    kept = front(points)
    thick: list[float] = np.diff(kept[:, 0], prepend=0.0).tolist()
    slices = (step * hypervolume(kept[at:, 1:]) for at, step in enumerate(thick))
    return sum(slices, 0.0)


def added_volume(points: Numbers, new: Numbers) -> float:
    """Return the volume that a point, (M,), dominates beyond others, (N, M)."""
    if (points >= new).all(axis=1).any():
        return 0.0
    return float(np.prod(new)) - hypervolume(np.minimum(points, new))
