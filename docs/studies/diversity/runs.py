"""Makes the runs of the study of diversity, for docs/diversity.md.

    python -m docs.studies.diversity.runs              # start, or go on after an end
    python -m docs.studies.diversity.runs --missing    # count the runs that lack
    python -m docs.studies.diversity.runs --births 60 --seeds 2 --data /some/where

Rows are kept in docs/data/diversity, one per run and one per run and 150 births. Runs
that have rows are skipped. A run of 3,000 births takes about a quarter of an hour of
one core; two are made side by side.
"""

import argparse
import shutil
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from itertools import product
from pathlib import Path
from tempfile import TemporaryDirectory
from threading import Lock
from typing import Any

import numpy as np

import revolve as rv
from analysis.figures.archive_maps import archive_maps, draw_map
from analysis.measures.load import read_run
from analysis.measures.study import measure_run
from docs.studies.pages import DOCS, PICTURES, append_csv, csv_rows
from revolve.suite.runs import in_window

DATA = DOCS / "data" / "diversity"
REFERENCE = "scenario1"
EXPERIMENTS = (REFERENCE, "map-elites", "dominated-novelty", "age-layered")
SEEDS, BIRTHS, EVERY = 10, 3000, 150
LATER = 4
"""Windows after the first one, in which the best robot is evaluated again."""
MEASURES = ("coverage", "qd_score", "archive_entropy", "hypervolume", "novelty",
            "diversity", "phylogenetic_diversity", "fitness")  # fmt: skip
MAPPED = ("map-elites", 1)
"""Experiment and seed of the run whose map is a picture of the page."""
AT_ONCE = 2
Row = dict[str, Any]
writing = Lock()
"""Rows are written one after the other."""


def planned(
    seeds: int = SEEDS, experiments: Iterable[str] = EXPERIMENTS
) -> Iterator[tuple[str, int]]:
    """Yield experiment and seed of all runs, seed by seed."""
    yield from (
        (name, seed) for seed, name in product(range(1, seeds + 1), experiments)
    )


def experiment(name: str) -> rv.Experiment:
    """Return an experiment; all have the cells of ``map-elites``."""
    settings = rv.Experiment.read("map-elites").settings
    cells = {key: settings[key] for key in ("measures", "grid")}
    return rv.Experiment.read(name, **cells)


def make(own: tuple[str, int], *, births: int, place: Path, data: Path) -> None:
    """Make a run; keep its rows, its own row last, which says that all are there."""
    name, seed = own
    folder = place / f"{name}-{seed}"
    shutil.rmtree(folder, ignore_errors=True)
    given = experiment(name)
    run = rv.run(given, seed=seed, births=births, workers=1, out=folder)
    names = {"experiment": name, "seed": seed}
    courses = course_rows(run, births)
    best = best_row(run, given)
    with writing:
        for row in courses:
            append_csv(data / "courses.csv", names | row)
        if own == MAPPED and data == DATA:
            draw(run)
        append_csv(data / "runs.csv", names | courses[-1] | best)
    shutil.rmtree(folder)
    print(name, seed, flush=True)


def course_rows(run: rv.Run, births: int) -> list[Row]:
    """Return the measures at each ``EVERY`` births, of the last population by then."""
    measured = measure_run(read_run(run.folder), "parent").tables["populations"]
    populations = measured.sort_by("births").to_pylist()
    evaluations = run.evaluations.to_pandas().sort_values("birth")
    best = np.maximum.accumulate(evaluations["fitness"].fillna(0.0))
    rows = []
    for mark in range(min(EVERY, births), births + 1, EVERY):
        last = [row for row in populations if row["births"] <= mark][-1]
        values = {key: f"{last[key]:.6g}" for key in MEASURES}
        so_far = best[(evaluations["birth"] < mark).to_numpy()].iloc[-1]
        rows.append({"births": mark, **values, "best": f"{so_far:.6g}"})
    return rows


def best_row(run: rv.Run, given: rv.Experiment) -> Row:
    """Return the fitness of the fittest robot ever in its first and later windows."""
    (robot,) = run.best_ever()
    windows = [
        rv.evaluate(robot, in_window(given, number)).fitness or 0.0
        for number in range(1 + LATER)
    ]
    return {"first": f"{windows[0]:.6g}", "later": f"{np.mean(windows[1:]):.6g}"}


def draw(run: rv.Run) -> None:
    """Write the map of a run as a picture of the page."""
    loaded = read_run(run.folder)
    cells = measure_run(loaded, "parent").tables["cells"]
    (own,), _ = archive_maps(cells, {loaded.folder: loaded})
    draw_map({}, own, "m/s").savefig(PICTURES / "diversity-map.png", dpi=200)


def run_missing(
    about: str | None,
    experiments: Iterable[str],
    births: int,
    data: Path,
    make: Callable[..., None],
) -> None:
    """Make the runs that are missing; flags of the command line change the defaults.

    Args:
        about: docstring of the study.
        experiments: their names.
        births: births of each run.
        data: folder of the rows; ``runs.csv`` has one for each run that is made.
        make: makes a run, given its experiment and seed, ``births``, a ``place`` for
            its folder, and ``data``.
    """
    parser = argparse.ArgumentParser(description=about)
    parser.add_argument("--missing", action="store_true")
    parser.add_argument("--seeds", type=int, default=SEEDS)
    parser.add_argument("--births", type=int, default=births)
    parser.add_argument("--data", type=Path, default=data)
    options = parser.parse_args()
    plan = [*planned(options.seeds, experiments)]
    kept = {
        (row["experiment"], int(row["seed"]))
        for row in csv_rows(options.data / "runs.csv")
    }
    runs = [own for own in plan if own not in kept]
    if options.missing:
        print(f"{len(runs)} of {len(plan)} runs are missing")
        return
    with TemporaryDirectory() as place, ThreadPoolExecutor(AT_ONCE) as pool:
        one = partial(make, births=options.births, place=Path(place), data=options.data)
        for _ in pool.map(one, runs):
            pass


if __name__ == "__main__":
    run_missing(__doc__, EXPERIMENTS, BIRTHS, DATA, make)
