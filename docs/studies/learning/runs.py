"""Makes the runs of the study of remedies of learning, for docs/learning.md.

    python -m docs.studies.learning.runs              # start, or go on after an end
    python -m docs.studies.learning.runs --missing    # count the runs that lack
    python -m docs.studies.learning.runs --births 180 --seeds 2 --data /some/where

All runs have equally many evaluations: with a budget of six trials, a sixth of the
births. Rows are kept in docs/data/learning, one per run. Runs that have rows are
skipped. A run takes about two minutes of one idle core; two are made side by side.
"""

import shutil
from pathlib import Path
from typing import Any

import pyarrow.compute as pc

import revolve as rv
from docs.studies.diversity.runs import best_row, run_missing, writing
from docs.studies.pages import DOCS, append_csv

DATA = DOCS / "data" / "learning"
REFERENCE = "none"
EVALUATIONS, BUDGET = 1500, 6
_LEARNING: dict[str, Any] = {"learner": "(1+1)-es", "budget": BUDGET}
_MODULAR: dict[str, Any] = {"brain": {"type": "modular"}, "space": {"max_hidden": 60}}
EXPERIMENTS: dict[str, dict[str, Any]] = {
    REFERENCE: {},
    "learning": {"learning": _LEARNING},
    "samples": {"learning": {**_LEARNING, "inherit": "samples"}},
    "peers": {"learning": {**_LEARNING, "peers": 2}},
    "modular": _MODULAR,
    "modular, learning": {**_MODULAR, "learning": _LEARNING},
    "modular, samples": {
        **_MODULAR, "learning": {**_LEARNING, "inherit": "samples"},
    },
}  # fmt: skip
"""Changes of ``scenario1`` by name."""


def make(own: tuple[str, int], *, births: int, place: Path, data: Path) -> None:
    """Make a run of so many evaluations, and keep its row."""
    name, seed = own
    given = rv.Experiment.read("scenario1", **EXPERIMENTS[name])
    trials = given.settings.get("learning", {}).get("budget", 1)
    folder = place / f"{name}-{seed}"
    run = rv.run(given, seed=seed, births=births // trials, workers=1, out=folder)
    last = run.population.filter(
        pc.equal(run.population["births"], pc.max(run.population["births"]))
    )
    row = {
        "experiment": name,
        "seed": seed,
        "births": births // trials,
        "evaluations": births // trials * trials,
        "mean": f"{pc.mean(last['fitness']).as_py():.6g}",
        **best_row(run, given),
    }
    with writing:
        append_csv(data / "runs.csv", row)
    shutil.rmtree(folder)
    print(name, seed, flush=True)


if __name__ == "__main__":
    run_missing(__doc__, EXPERIMENTS, EVALUATIONS, DATA, make)
