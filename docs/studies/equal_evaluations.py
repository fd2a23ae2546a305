"""Compares learning and robust evaluation with scenario 1 at equal evaluations.

    python -m docs.studies.equal_evaluations keep RUN ...   # keep rows of finished runs
    python -m docs.studies.equal_evaluations page           # write the tables
    python -m docs.studies.equal_evaluations page --check   # fail if they differ

Each run has 3000 evaluations: 3000 births of ``scenario1``, 150 births of ``learning``
with 20 trials, 750 births of ``robust`` with 4 draws. The fittest robot of a last
population is evaluated again under three changes of its simulation. Rows are in
docs/equal_evaluations.csv, the tables in docs/learning.md and docs/robustness.md.
"""

import csv
import sys
from collections.abc import Sequence
from pathlib import Path
from statistics import mean

import numpy as np
import pyarrow.compute as pc
from msgspec import structs

from analysis.comparison.statistics import mean_difference, rank_sum_p
from docs.studies.pages import DOCS, Parts, command, csv_rows, markdown
from docs.studies.tasks import best_robot, last_population
from docs.studies.thesis.data import DATA, SELECTED, WINDOWS
from schema.experiment.document import Experiment
from schema.experiment.settings import evaluation_settings_of
from schema.robot.robot import Robot
from worker.robot.evaluation import evaluate
from worker.robot.robustness import all_changes, rejudge

ROWS = DOCS / "equal_evaluations.csv"
BASE = "scenario1"
"""Experiment with which the others are compared."""
ALONE = "without changes"
CHANGES = ("time step 0.001 s", "friction 0.9", "friction 1.1")
"""Changes of ``revolve robustness`` under which winners are evaluated."""

Row = dict[str, str]


def row_of(folder: Path) -> Row:
    """Return the row of a finished run: its last population, and its winner."""
    rules, _, robot = best_robot(folder)
    last = last_population(folder)
    births = last["births"][0].as_py()
    if births != rules.births:
        sys.exit(f"{folder}: must have {rules.births} births, got {births}")
    trials = rules.learning.budget if rules.learning else 1
    draws = rules.robust.draws if rules.robust else 1
    found: dict[str, object] = {
        "experiment": rules.name,
        "run": folder.name,
        "births": births,
        "evaluations": births * trials * draws,
        "mean": pc.mean(last["fitness"]).as_py(),
        "best": pc.max(last["fitness"]).as_py(),
        **under_changes(robot, rules),
    }
    return {
        name: f"{value:.9g}" if isinstance(value, float) else str(value)
        for name, value in found.items()
    }


def under_changes(robot: Robot, rules: Experiment) -> dict[str, float]:
    """Return the fitness of a robot without changes and under ``CHANGES``, by name.

    An evaluation that fails counts 0.
    """
    settings = structs.replace(evaluation_settings_of(rules), robust=None)
    changes = [each for each in all_changes(settings) if each.name in CHANGES]
    assert {each.name for each in changes} == set(CHANGES)
    found = {ALONE: evaluate(robot, settings).fitness}
    for change, fitness in rejudge(robot, changes):
        found[change.name] = fitness or 0.0
    return found


def keep(folders: Sequence[Path]) -> None:
    """Write rows of runs; they replace the rows of the same experiments."""
    new = [row_of(folder) for folder in folders]
    names = {row["experiment"] for row in new}
    rows = [row for row in csv_rows(ROWS) if row["experiment"] not in names] + new
    with ROWS.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [*new[0]], lineterminator="\n")
        writer.writeheader()
        writer.writerows(sorted(rows, key=lambda row: row["experiment"]))


def compared(experiment: str, rows: Sequence[Row]) -> list[str]:
    """Return the lines of a table: an experiment, ``BASE``, and their difference."""
    heads = ["last population", "runs", "births", "mean fitness [m/s]", "best [m/s]"]
    both = {name: _of(name, rows) for name in (experiment, BASE)}
    lines = []
    for name, own in both.items():
        (births,) = {row["births"] for row in own}
        means = (f"{mean(numbers(own, key)):.4f}" for key in ("mean", "best"))
        lines.append([f"`{name}`", str(len(own)), births, *means])
    cells = []
    for key in ("mean", "best"):
        ours, base = (np.array(numbers(own, key)) for own in both.values())
        more, low, high = mean_difference(ours, base)
        p = rank_sum_p(ours, base)
        cells.append(f"{more:+.4f} ({low:+.4f} to {high:+.4f}), p = {p:.2g}")
    return markdown(heads, [*lines, ["difference (95 % interval)", "", "", *cells]])


def winners(experiment: str, rows: Sequence[Row]) -> list[str]:
    """Return the lines of a table: what the winners of both experiments keep.

    The share is the mean fitness under ``CHANGES`` by the fitness without changes.
    """
    heads = ["winners of", "runs", "fitness without changes [m/s]",
             "under changes [m/s]", "kept (range)"]  # fmt: skip
    lines = []
    for name in (experiment, BASE):
        own = _of(name, rows)
        alone = np.array(numbers(own, ALONE))
        under = np.mean([numbers(own, change) for change in CHANGES], axis=0)
        shares = 100 * under / alone
        spread = f"({shares.min():.0f} to {shares.max():.0f} %)"
        lines.append([
            f"`{name}`", str(len(own)), f"{np.median(alone):.4f}",
            f"{np.median(under):.4f}", f"{np.median(shares):.0f} % {spread}",
        ])  # fmt: skip
    return markdown(heads, lines)


def campaign_winners() -> list[str]:
    """Return what the best robots of the campaign's repeats of ``BASE`` keep."""
    rows = [row for row in csv_rows(DATA / WINDOWS) if row["experiment"] == BASE]
    lines = []
    for text, first, end in (("0 to 9", 0, 10), ("10 to 29", 10, 30), ("all", 0, 30)):
        own = [row for row in rows if first <= int(row["run"]) < end]
        under = np.mean([numbers(own, change) for change in CHANGES], axis=0)
        shares = 100 * under / np.array(numbers(own, SELECTED))
        spread = f"({shares.min():.0f} to {shares.max():.0f} %)"
        lines.append([text, str(len(own)), f"{np.median(shares):.1f} % {spread}"])
    return markdown([f"repeats of `{BASE}`", "runs", "kept (range)"], lines)


def _of(experiment: str, rows: Sequence[Row]) -> list[Row]:
    return [row for row in rows if row["experiment"] == experiment]


def numbers(rows: Sequence[Row], key: str) -> list[float]:
    """Return the numbers of a column."""
    return [float(row[key]) for row in rows]


def pages() -> dict[str, Parts]:
    """Return the generated parts of the pages."""
    rows = csv_rows(ROWS)
    return {
        "learning.md": {"equal evaluations": compared("learning", rows)},
        "robustness.md": {
            "equal evaluations": compared("robust", rows),
            "winners": winners("robust", rows),
            "campaign winners": campaign_winners(),
        },
    }


main = command(__doc__, pages, keep=("keep the results of finished runs", keep))

if __name__ == "__main__":
    sys.exit(main(None))
