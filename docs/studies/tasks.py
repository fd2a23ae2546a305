"""Compares evolution with random search on each task of docs/tasks.md.

    python -m docs.studies.tasks run runs/tasks    # start, or go on after an end
    python -m docs.studies.tasks page              # write the table of docs/tasks.md

Each search has the same number of births. The random one is the shipped experiment with
``selection.parents = "none"``, as in ``no-reproduction``. Rows are kept in
docs/tasks_data/results.csv, one per finished run.
"""

import os
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from analysis.measures.load import read_runs
from docs.studies.pages import (
    DOCS,
    ROOT,
    Parts,
    append_csv,
    command,
    csv_rows,
    markdown,
)
from schema.experiment.document import Experiment
from schema.experiment.file import experiment_from_text
from schema.experiment.identity import Identity, Origin
from schema.experiment.settings import evaluation_settings_of
from schema.formats.files import write_robot
from schema.robot.ids import BirthId
from schema.robot.robot import Robot
from schema.tables.files import read_table
from schema.wire.born import robot_of_birth
from worker.robot.evaluation import evaluate

SHIPPED = ROOT / "schema" / "experiment" / "shipped"
ROBOTS = DOCS / "tasks_data"
"""Best robot of each task with seed ``DRAWN``, for docs/studies/tasks_pictures.py."""
DRAWN = 1
ROWS = ROBOTS / "results.csv"

TASKS = {
    "locomotion": ("scenario1", "m/s"),
    "directed-locomotion": ("directed-locomotion", "m/s"),
    "target": ("target", "m/s"),
    "light": ("light", "1"),
    "turning": ("turning", "rad/s"),
    "balance": ("balance", "m"),
    "stairs": ("stairs", "m/s"),
    "rough-ground": ("rough-ground", "m/s"),
}
"""Shipped experiment of each task, and the unit of its fitness."""
ALTERED = {
    "locomotion, cpg": '[brain]\ntype = "cpg"\n',
    "locomotion, cppn": '[encoding]\ntype = "cppn"\n',
}
"""What the experiments of another brain and encoding add to scenario 1."""
SEARCHED = {**TASKS, **dict.fromkeys(ALTERED, TASKS["locomotion"])}
SEARCHES = ("evolution", "random")
SEEDS = range(1, 11)
BIRTHS = 600
TRIALS = range(1000, 1020)
"""Trials in which the best robots of a task with pushes are re-evaluated."""
RESAMPLES = 10_000
FEW = 3
"""Least number of seeds for an interval."""
_RANDOM = 'parents = "none"'


def run(folders: Sequence[Path]) -> None:
    """Run all missing runs in a folder, at the lowest priority, seed by seed."""
    (folder,) = folders
    os.nice(19)
    folder.mkdir(parents=True, exist_ok=True)
    for seed in SEEDS:
        for task in SEARCHED:
            for search in SEARCHES:
                known = {(r["task"], r["search"], int(r["seed"])) for r in rows()}
                if (task, search, seed) not in known:
                    _run_one(folder, task, search, seed)


def _run_one(folder: Path, task: str, search: str, seed: int) -> None:
    """Run or resume one search, and keep its row."""
    name = f"{_file_name(task)}-{search}"
    out = folder / f"{name}-{seed}"
    if (out / "run.json").exists():
        words = ["resume", str(out)]
    else:
        document = folder / f"{name}.toml"
        document.write_text(_document(task, search), encoding="utf-8")
        words = ["run", str(document), "--seed", str(seed), "--out", str(out)]
        words += ["--births", str(BIRTHS)]
    words += ["--workers", "1", "--quiet"]
    print(f"revolve {' '.join(words)}", flush=True)
    subprocess.run([sys.executable, "-m", "revolve", *words], cwd=ROOT, check=True)
    row = {"task": task, "search": search, "seed": seed, **_outcome(out)}
    append_csv(ROWS, {**row, "commit": _commit()})
    if search == "evolution" and seed == DRAWN:
        experiment, _, robot = best_robot(out)
        path = ROBOTS / f"{_file_name(task)}.yaml"
        write_robot(robot, path, evaluation_settings_of(experiment))
    shutil.rmtree(out)


def _file_name(task: str) -> str:
    """Return the name of a task's files."""
    return task.replace(", ", "-")


def _document(task: str, search: str) -> str:
    """Return the experiment of a search: the shipped one, with other parents."""
    shipped, _ = SEARCHED[task]
    text = (SHIPPED / f"{shipped}.toml").read_text(encoding="utf-8")
    text += "\n" + ALTERED.get(task, "")
    if search == "random":
        text += f"\n[selection]\n{_RANDOM}\n"
    return text


def last_population(out: Path) -> pa.Table:
    """Return the rows of the last recorded population."""
    population = read_table(out, "population")
    last = pc.max(population["births"]).as_py()
    return population.filter(pc.equal(population["births"], last))


def _outcome(out: Path) -> dict[str, object]:
    """Return births, best and mean fitness of the last population, and failures.

    Where pushes differ from trial to trial, the best fitness is the mean over new
    trials, because the greatest of many fitness values was lucky, too.
    """
    alive = last_population(out)
    fitness = np.array(alive["fitness"].to_pylist(), dtype=float)
    status = read_table(out, "evaluations")["status"].to_pylist()
    best = float(fitness.max())
    experiment, birth, robot = best_robot(out)
    if experiment.environment.push_impulse:
        settings = evaluation_settings_of(experiment)
        own = [Identity(Origin(), BirthId(0, birth), trial) for trial in TRIALS]
        again = [evaluate(robot, settings, each).fitness for each in own]
        best = sum(again) / len(again)
    return {
        "births": alive["births"][0].as_py(),
        "best": best,
        "mean": float(fitness.mean()),
        "failed": sum(each != "ok" for each in status),
    }


def best_robot(out: Path) -> tuple[Experiment, int, Robot]:
    """Return the experiment of a run, and birth and robot of the last best fitness."""
    (one,), _ = read_runs([out])
    experiment = experiment_from_text(one.document, is_own=True)
    alive = last_population(out)
    best = int(np.argmax(alive["fitness"].to_numpy()))
    birth = alive["birth"][best].as_py()
    births = read_table(out, "births")
    (own,) = births.filter(pc.equal(births["birth"], birth)).to_pylist()
    robot = robot_of_birth(own["genome"], own["robot"], experiment)
    return experiment, birth, robot


def _commit() -> str:
    git = shutil.which("git")
    if git is None:
        return ""

    def said(*words: str) -> str:
        done = subprocess.run(
            [git, "-C", str(ROOT), *words], capture_output=True, text=True, check=False
        )
        return done.stdout.strip()

    # The rows that this script writes change no birth.
    own = ":!docs/tasks_data"
    is_changed = said("status", "--porcelain", "--untracked-files=no", "--", ".", own)
    return said("rev-parse", "--short", "HEAD") + ("-dirty" if is_changed else "")


def rows() -> list[dict[str, str]]:
    """Return the rows that are kept, in the order in which runs finished."""
    return csv_rows(ROWS)


def difference(
    first: Sequence[float], second: Sequence[float]
) -> tuple[float, float, float]:
    """Return the difference of two medians, and its 95 % bootstrap interval.

    Args:
        first: one number per run.
        second: one number per run of the other search.

    Source: Efron, *Bootstrap methods*, 1979: percentiles, with a fixed seed.
    """
    rng = np.random.default_rng(1)
    medians = [
        np.median(rng.choice(each, (RESAMPLES, len(each))), axis=1)
        for each in (first, second)
    ]
    low, high = np.percentile(medians[0] - medians[1], (2.5, 97.5)).tolist()
    return float(np.median(first) - np.median(second)), low, high


def table(kept: Sequence[Mapping[str, str]]) -> list[str]:
    """Return the lines of the table: seeds that both searches have."""
    heads = ["task", "seeds", "evolution", "random search", "difference",
             "95 % interval"]  # fmt: skip
    lines = []
    for task, (_, unit) in SEARCHED.items():
        found = {
            search: {
                int(row["seed"]): float(row["best"])
                for row in kept
                if (row["task"], row["search"]) == (task, search)
            }
            for search in SEARCHES
        }
        seeds = sorted(set(found["evolution"]) & set(found["random"]))
        if not seeds:
            continue
        first, second = ([found[search][seed] for seed in seeds] for search in SEARCHES)
        change, low, high = difference(first, second)
        interval = (
            f"{low:+.3f} to {high:+.3f}" if len(seeds) >= FEW else "too few seeds"
        )
        suffix = "" if unit == "1" else f" {unit}"
        lines.append([
            task, str(len(seeds)), f"{np.median(first):.3f}{suffix}",
            f"{np.median(second):.3f}{suffix}", f"{change:+.3f}{suffix}", interval,
        ])  # fmt: skip
    return markdown(heads, lines)


def pages() -> dict[str, Parts]:
    """Return the generated part of the page."""
    return {"tasks.md": {"results": ["", *table(rows()), ""]}}


main = command(__doc__, pages, run=("run in a folder what is missing", run))

if __name__ == "__main__":
    sys.exit(main(None))
