"""Benchmarks of the analysis: a pair of bodies, and the campaign of the thesis."""

import subprocess
import sys
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest

from analysis.measures.bodies import encode
from schema.robot.body_distance import tree_distances
from schema.tables.columns import BIRTHS
from tests.analysis.bodies import column, random_body
from tests.analysis.campaign import BROODS, random_bodies, write_run

pytestmark = pytest.mark.benchmark

PAIR_BUDGET_US = 30.0
CAMPAIGN_BUDGET_S = 120.0
RUNS, BIRTHS_EACH = 30, 3000


def test_distance_of_bodies_of_30_parts() -> None:
    rng = np.random.default_rng(1)
    trees = encode(column([random_body(rng, 30) for _ in range(150)]))
    first, second = np.triu_indices(150, 1)
    tree_distances(trees, first[:1], second[:1])
    times = []
    for _ in range(5):
        start = time.perf_counter()
        tree_distances(trees, first, second)
        times.append(time.perf_counter() - start)
    spent = min(times) / len(first) * 1e6
    print(f"\n{spent:.1f} us per pair of 30-node trees (budget {PAIR_BUDGET_US})")
    assert spent <= PAIR_BUDGET_US


def _write_experiment(root: Path, experiment: str) -> None:
    rng = np.random.default_rng(list(experiment.encode()))
    kind = BIRTHS.field("body").type
    bodies = pa.array(random_bodies(rng, 2 * BIRTHS_EACH), kind)
    for number in range(RUNS):
        folder = root / f"{experiment}-{number}"
        write_run(folder, experiment, number, BIRTHS_EACH, bodies)


def test_all_measures_of_a_campaign(tmp_path: Path) -> None:
    runs = tmp_path / "runs"
    with ProcessPoolExecutor(2, get_context("spawn")) as pool:
        list(pool.map(_write_experiment, [runs] * len(BROODS), BROODS))
    start = time.perf_counter()
    words = ["analyze", str(runs), "--out", str(tmp_path / "out"), "--processes", "2"]
    subprocess.run([sys.executable, "-m", "revolve", *words], check=True)
    spent = time.perf_counter() - start
    print(f"\n{RUNS * len(BROODS)} runs of {BIRTHS_EACH} births: {spent:.0f} s")
    findings = pq.read_table(tmp_path / "out" / "measures" / "findings.parquet")
    assert findings["verdict"].null_count == 0
    assert spent <= CAMPAIGN_BUDGET_S
