"""A synthetic campaign: run folders as large as the thesis's, without simulation."""

import json
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq

from schema.tables.columns import TABLES
from schema.tables.files import parquet_path
from tests.analysis.bodies import Body, random_body
from tests.analysis.tables import blank

FOUNDERS = 15
ONLINE = "scenario3"
BROODS = {
    "scenario1": 15,
    "scenario2": 1,
    "no-selection": 15,
    "no-reproduction": 15,
    ONLINE: 1,
}
"""Births between two recorded populations, by experiment."""
_LIVING_ONLINE = 22
_SAMPLE_S, _BIRTH_S = 5.0, 15.0


def random_bodies(rng: np.random.Generator, count: int) -> list[Body]:
    """Return different bodies, as large as evolved ones: 20 parts on average."""
    sizes = np.clip(rng.normal(20, 5, count).round(), 3, 30).astype(int)
    return [random_body(rng, int(size)) for size in sizes]


def write_run(
    folder: Path, experiment: str, number: int, births: int, bodies: pa.Array
) -> None:
    """Write a finished run in which the living are replaced at random.

    Drift keeps more individuals, hence more pairs of bodies, than selection does.

    Args:
        folder: to be made.
        experiment: a key of ``BROODS``.
        number: of the repeat; the run's only seed.
        births: of the run.
        bodies: at least as many.
    """
    rng = np.random.default_rng([number, *experiment.encode()])
    is_online = experiment == ONLINE
    arena = {"record_touches": True} if is_online else None
    document = json.dumps({"name": experiment, "births": births, "arena": arena})
    details = {"name": experiment, "run": number, "seed": 1, "document": document}
    folder.mkdir(parents=True)
    (folder / "run.json").write_text(json.dumps(details))
    (folder / "state").write_text("finished")
    fitness = rng.gamma(2, 0.05, births)
    levels = _levels(rng, experiment, births)
    members = np.concatenate([living for _, living in levels])
    counts = np.repeat(
        [count for count, _ in levels], [len(living) for _, living in levels]
    )
    tables = {
        "births": _births(rng, experiment, births, bodies),
        "population": {
            "births": counts, "birth": members, "fitness": fitness[members]
        },
    }  # fmt: skip
    if is_online:
        tables["fitness"] = _samples(rng, levels)
        tables["touches"] = _touches(rng, levels)
        tables["deaths"] = {"birth": []}
    else:
        tables["evaluations"] = {
            "birth": np.arange(births), "status": ["ok"] * births, "fitness": fitness
        }  # fmt: skip
    for name, columns in tables.items():
        path = parquet_path(folder, experiment, number, name)
        path.parent.mkdir(parents=True, exist_ok=True)
        pq.write_table(_filled(name, columns), path)


Columns = dict[str, object]
Levels = list[tuple[int, "np.typing.NDArray[np.int64]"]]


def _levels(rng: np.random.Generator, experiment: str, births: int) -> Levels:
    brood = BROODS[experiment]
    size = _LIVING_ONLINE if experiment == ONLINE else FOUNDERS
    living = np.arange(FOUNDERS)
    found = [(FOUNDERS, living)]
    for count in range(FOUNDERS + brood, births + 1, brood):
        newborn = np.arange(count - brood, count)
        candidates = np.concatenate([living, newborn])
        keep = min(len(candidates), size)
        chosen = rng.permutation(len(candidates))[:keep]
        if brood == 1:  # the newborn lives, as the dearest case
            chosen[0] = len(candidates) - 1
            chosen = np.unique(chosen)
        living = np.sort(candidates[chosen])
        found.append((count, living))
    return found


def _births(
    rng: np.random.Generator, experiment: str, births: int, bodies: pa.Array
) -> Columns:
    parents = []
    for number in range(births):
        has_any = number >= FOUNDERS and experiment != "no-reproduction"
        oldest = max(0, number - 5 * FOUNDERS)
        couple = rng.integers(oldest, number, 2).tolist() if has_any else []
        parents.append([{"island": 0, "birth": parent} for parent in couple])
    mine = bodies.take(pa.array(rng.permutation(len(bodies))[:births]))
    parts = np.asarray(mine.value_lengths())
    seconds = _BIRTH_S * np.arange(births)
    return {
        "birth": np.arange(births),
        "parents": parents,
        "rank": np.arange(births) // FOUNDERS + 1,
        "body": mine,
        "genome": [rng.bytes(300)] * births,
        "parts": parts,
        "joints": parts // 2,
        "motors": parts // 3,
        "extremities": np.maximum(parts // 4, 1),
        "hidden": rng.integers(0, 11, births),
        "connections": rng.integers(0, 30, births),
        "sim_time_s": seconds if experiment == ONLINE else None,
    }


def _samples(rng: np.random.Generator, levels: Levels) -> Columns:
    """Return three fitness samples of each robot between two births."""
    rows = [
        (count, living, count * _BIRTH_S + sample * _SAMPLE_S)
        for count, living in levels
        for sample in range(3)
    ]
    robots = np.concatenate([living for _, living, _ in rows])
    sizes = [len(living) for _, living, _ in rows]
    counts = np.repeat([count for count, _, _ in rows], sizes)
    return {
        "birth": robots,
        "sim_time_s": np.repeat([time for _, _, time in rows], sizes),
        "births": counts,
        "fitness": rng.gamma(2, 0.05, len(robots)),
        "is_mature": robots < counts - 1,
    }


def _touches(rng: np.random.Generator, levels: Levels) -> Columns:
    pairs = np.array([rng.choice(living, 2, replace=False) for _, living in levels])
    return {
        "birth": pairs[:, 0],
        "other_birth": pairs[:, 1],
        "sim_time_s": np.array([count * _BIRTH_S for count, _ in levels]),
        "over_s": np.full(len(pairs), _BIRTH_S),
        "duration_s": rng.uniform(0, 3, len(pairs)),
    }


def _filled(name: str, columns: Columns) -> pa.Table:
    """Return a table with these columns; all others are 0, empty or null."""
    schema = TABLES[name]
    rows = len(columns["birth"])  # type: ignore[arg-type]
    blanks = {field.name: [blank(field)] * rows for field in schema}
    blanks["seed"] = [1] * rows
    known = {key: values for key, values in columns.items() if values is not None}
    return pa.table({**blanks, "record": range(rows), **known}, schema)
