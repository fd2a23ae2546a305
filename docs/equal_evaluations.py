"""Compares learning and robust evaluation with scenario 1 at equal evaluations.

    python -m docs.equal_evaluations keep RUN ...   # keep rows of finished runs
    python -m docs.equal_evaluations page           # write the tables
    python -m docs.equal_evaluations page --check   # fail if they differ

Each run has 3000 evaluations: 3000 births of ``scenario1``, 150 births of ``learning``
with 20 trials, 750 births of ``robust`` with 4 draws. The fittest robot of a last
population is evaluated again under three changes of its simulation. Rows are in
docs/equal_evaluations.csv, the tables in docs/learning.md and docs/robustness.md.
"""

import argparse
import csv
import sys
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from statistics import mean

import numpy as np
import pyarrow.compute as pc
from msgspec import structs

from analysis.comparison.statistics import mean_difference, rank_sum_p
from docs.page_parts import csv_rows, write_parts
from docs.tasks_campaign import best_robot, last_population
from schema.experiment.document import Experiment
from schema.experiment.settings import evaluation_settings_of
from schema.robot.robot import Robot
from worker.robot.evaluation import evaluate
from worker.robot.robustness import all_changes, rejudge

DOCS = Path(__file__).resolve().parent
ROWS = DOCS / "equal_evaluations.csv"
BASE = "scenario1"
"""Experiment with which the others are compared."""
ALONE = "without changes"
CHANGES = ("time step 0.001 s", "friction 0.9", "friction 1.1")
"""Changes of ``revolve robustness`` under which winners are evaluated."""

Row = dict[str, str]


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one of the commands; return 0, or 1 if a check fails."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    commands = parser.add_subparsers(dest="command", required=True)
    keeping = commands.add_parser("keep", help="keep the results of finished runs")
    keeping.add_argument("runs", type=Path, nargs="+", help="run folders")
    writing = commands.add_parser("page", help="write the tables")
    writing.add_argument("--check", action="store_true", help="write nothing; compare")
    options = parser.parse_args(arguments)
    if options.command == "page":
        return write_pages(is_check=options.check)
    keep([row_of(folder) for folder in options.runs])
    return 0


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


def keep(new: Sequence[Row]) -> None:
    """Write rows; they replace the rows of the same experiments."""
    names = {row["experiment"] for row in new}
    rows = [row for row in kept() if row["experiment"] not in names] + [*new]
    with ROWS.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, [*new[0]], lineterminator="\n")
        writer.writeheader()
        writer.writerows(sorted(rows, key=lambda row: row["experiment"]))


def kept() -> list[Row]:
    """Return all rows."""
    return csv_rows(ROWS)


def compared(experiment: str, rows: Sequence[Row]) -> Iterator[str]:
    """Yield the lines of a table: an experiment, ``BASE``, and their difference."""
    yield "| last population | runs | births | mean fitness [m/s] | best [m/s] |"
    yield "|---|---|---|---|---|"
    found = {name: _of(name, rows) for name in (experiment, BASE)}
    for name, own in found.items():
        (births,) = {row["births"] for row in own}
        means = (f"{mean(numbers(own, key)):.4f}" for key in ("mean", "best"))
        yield f"| `{name}` | {len(own)} | {births} | {' | '.join(means)} |"
    cells = []
    for key in ("mean", "best"):
        ours, base = (np.array(numbers(own, key)) for own in found.values())
        more, low, high = mean_difference(ours, base)
        p = rank_sum_p(ours, base)
        cells.append(f"{more:+.4f} ({low:+.4f} to {high:+.4f}), p = {p:.2g}")
    yield f"| difference (95 % interval) | | | {' | '.join(cells)} |"


def winners(experiment: str, rows: Sequence[Row]) -> Iterator[str]:
    """Yield the lines of a table: what the winners of both experiments keep.

    The share is the mean fitness under ``CHANGES`` by the fitness without changes.
    """
    yield (
        "| winners of | runs | fitness without changes [m/s] | under changes [m/s] "
        "| kept (range) |"
    )
    yield "|---|---|---|---|---|"
    for name in (experiment, BASE):
        own = _of(name, rows)
        alone = np.array(numbers(own, ALONE))
        under = np.mean([numbers(own, change) for change in CHANGES], axis=0)
        shares = 100 * under / alone
        yield (
            f"| `{name}` | {len(own)} | {np.median(alone):.4f} | "
            f"{np.median(under):.4f} | {np.median(shares):.0f} % "
            f"({shares.min():.0f} to {shares.max():.0f} %) |"
        )


def _of(experiment: str, rows: Sequence[Row]) -> list[Row]:
    return [row for row in rows if row["experiment"] == experiment]


def numbers(rows: Sequence[Row], key: str) -> list[float]:
    """Return the numbers of a column."""
    return [float(row[key]) for row in rows]


def parts() -> dict[Path, Mapping[str, list[str]]]:
    """Return the generated parts of the pages, by page and name."""
    rows = kept()
    return {
        DOCS / "learning.md": {"equal evaluations": [*compared("learning", rows)]},
        DOCS / "robustness.md": {
            "equal evaluations": [*compared("robust", rows)],
            "winners": [*winners("robust", rows)],
        },
    }


def write_pages(*, is_check: bool) -> int:
    """Write the tables into their pages, or return 1 if a table differs from them."""
    command = "python -m docs.equal_evaluations page"
    return max(
        write_parts(path, generated, command, is_check=is_check)
        for path, generated in parts().items()
    )


if __name__ == "__main__":
    sys.exit(main())
