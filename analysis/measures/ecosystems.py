"""Arenas with own rules: courses over time, ages at death, couples, patches."""

from collections import Counter

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from analysis.measures.outputs import run_schema
from analysis.measures.population_table import individual_ids, rows_of
from analysis.measures.run_tables import RunTables

ENERGY = "energy"
"""Store whose mean is a course."""
_WHEN = ("island", "sim_time_s")


def life_courses(run: RunTables) -> pa.Table:
    """Return living robots, mean energy and new births of each arena at its samples.

    Source: own.
    """
    births = run.births.filter(run.births["sim_time_s"].is_valid())
    born = list(zip(*(births[name].to_pylist() for name in _WHEN), strict=True))
    samples: dict[tuple[int, float], list[float | None]] = {}
    fitness = run.tables["fitness"]
    columns = (fitness[name].to_pylist() for name in (*_WHEN, "stores"))
    for island, time_s, stores in zip(*columns, strict=True):
        energy = dict(stores or ()).get(ENERGY)
        samples.setdefault((island, time_s), []).append(energy)
    rows, before = [], dict.fromkeys((island for island, _ in samples), -np.inf)
    for island, time_s in sorted(samples):
        known = [energy for energy in samples[island, time_s] if energy is not None]
        since_s, before[island] = before[island], time_s
        values = {
            "living": len(samples[island, time_s]),
            "energy": sum(known) / len(known) if known else None,
            "born": sum(at == island and since_s < t <= time_s for at, t in born),
        }
        rows.append({"island": island, "sim_time_s": time_s, **values})
    return pa.Table.from_pylist(rows, run_schema("life_courses"))


def lifespans(run: RunTables) -> pa.Table:
    """Return the age of each robot at its death, and the reason; natives only.

    Source: own.
    """
    deaths = run.tables["deaths"]
    natives = deaths.filter(pc.equal(deaths["island"], deaths["birth_island"]))
    rows = rows_of(individual_ids(natives), run.births)
    natives, rows = natives.filter(pa.array(rows >= 0)), rows[rows >= 0]
    born_s = run.births["sim_time_s"].take(pa.array(rows))
    age_s = pc.subtract(natives["sim_time_s"], born_s)
    keys = natives.select(["island", "birth_island", "birth"])
    return keys.append_column("age_s", age_s).append_column("reason", natives["reason"])


def couples(run: RunTables) -> pa.Table:
    """Return the children of two named parents: where these were born, how related.

    Source: own.
    """
    rows, births = [], run.births.select(["x", "y"]).to_pylist()
    for mating in run.tables["matings"].to_pylist():
        parents = pa.Table.from_pylist(mating["parents"])
        first, *others = rows_of(individual_ids(parents, "island"), run.births).tolist()
        if mating["birth"] is None or len(others) != 1 or min(first, *others) < 0:
            continue
        (second,) = others
        lines = [run.lines[parent] | 1 << parent for parent in (first, second)]
        shared, either = lines[0] & lines[1], lines[0] | lines[1]
        rows.append(
            {
                **{name: mating[name] for name in ("island", "sim_time_s", "birth")},
                **{name: mating[name] for name in "xy"},
                **{f"first_{name}": births[first][name] for name in "xy"},
                **{f"second_{name}": births[second][name] for name in "xy"},
                "related": shared.bit_count() / either.bit_count(),
            }
        )
    return pa.Table.from_pylist(rows, run_schema("couples"))


def patch_means(run: RunTables) -> pa.Table:
    """Return the mean content of each patch at each of its places.

    Source: own.
    """
    keys = ["island", "patch", "x", "y", "radius_m"]
    grouped = run.tables["patches"].group_by(keys, use_threads=False)
    means = grouped.aggregate([("content", "mean")])
    return means.rename_columns([*keys, "content"])


def birth_places(run: RunTables) -> pa.Table:
    """Return where robots of arenas were born, and how many children they had.

    Source: own.
    """
    born = run.births.filter(run.births["x"].is_valid())
    children = Counter(row for parents in run.parents for row in parents)
    rows = rows_of(individual_ids(born, "island"), run.births).tolist()
    counts = pa.array([children[row] for row in rows], pa.int64())
    places = born.select(["island", "birth", "sim_time_s", "x", "y"])
    return places.append_column("children", counts)
