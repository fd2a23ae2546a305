"""Births of experiments with several objectives, and their Pareto fronts."""

from collections.abc import Mapping

import pyarrow as pa
import pyarrow.compute as pc

from analysis.measures.diversity.fronts import front
from analysis.measures.diversity.samples import numbers, samples
from analysis.measures.outputs import run_schema
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
