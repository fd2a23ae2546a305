"""Births of experiments with several objectives, and their Pareto fronts."""

from collections.abc import Mapping
from typing import Any

import numpy as np
import pyarrow as pa

from analysis.measures.diversity.fronts import front
from analysis.measures.diversity.samples import samples
from analysis.measures.load import island_settings
from analysis.measures.outputs import run_schema
from analysis.measures.run_tables import RunTables
from schema.experiment.document import Experiment

_FITNESS = "fitness"


def objectives_of(island: Experiment) -> Mapping[str, str]:
    """Return the objectives of ``nsga2``, "max" or "min" by name; empty without it."""
    own = island.selection
    objectives: Mapping[str, str] = {}
    if own.survivors == "nsga2":
        objectives = own.survivors_parameters["objectives"]
    elif own.parents == "nsga2":
        objectives = own.parents_parameters["objectives"]
    return objectives


def fronts(run: RunTables) -> pa.Table:
    """Return the first two objectives of all births, and which are on the front.

    The front is that of all births of an island in all of its objectives.
    """
    tables = [run_schema("fronts").empty_table()]
    homes = np.asarray(run.tables["evaluations"]["island"], np.int64)
    for island in np.unique(homes).tolist():
        objectives = objectives_of(island_settings(island, run.islands))
        if objectives:
            tables.append(_of_island(run, island, objectives))
    return pa.concat_tables(tables)


def _of_island(run: RunTables, island: int, objectives: Mapping[str, str]) -> pa.Table:
    names = [name for name in objectives if name != _FITNESS]
    evaluations, fitness = (run.tables[name] for name in ("evaluations", "fitness"))
    born = samples(evaluations, fitness, run.births, names).born_on(island)
    known = dict(zip(names, born.values.T, strict=True)) | {_FITNESS: born.fitness}
    signs = [1.0 if sense == "max" else -1.0 for sense in objectives.values()]
    points = np.stack([known[name] for name in objectives], axis=1) * signs
    best = {tuple(point) for point in front(points).tolist()}
    rows = run.births.take(pa.array(born.robots))
    (x_name, x_sense), (y_name, y_sense), *_ = objectives.items()
    columns: dict[str, Any] = {
        "island": pa.array([island] * len(born), pa.int32()),
        "birth_island": rows["island"],
        "birth": rows["birth"],
        "x_objective": [f"{x_name} ({x_sense})"] * len(born),
        "y_objective": [f"{y_name} ({y_sense})"] * len(born),
        "x": known[x_name],
        "y": known[y_name],
        "is_front": [tuple(point) in best for point in points.tolist()],
    }
    made = pa.table(columns)
    return made.select(run_schema("fronts").names).cast(run_schema("fronts"))
