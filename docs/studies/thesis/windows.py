"""Evaluates the best robots of the campaign in later windows and under changes.

    python -m docs.studies.thesis.windows              # those that have no row yet
    python -m docs.studies.thesis.windows --missing    # count them

The best robot of each last population in docs/data/final is simulated alone, as in
scenario 1, for 60 s in five windows of 12 s; in the first one also under changes of
time step, friction and start. docs/data/windows/robots.csv has one row per robot. Each
takes about five seconds of one core.
"""

import argparse
from pathlib import Path

from analysis.comparison.claims import TOUCHES
from docs.studies.pages import append_csv, csv_rows
from docs.studies.thesis.data import DATA, SELECTED, WINDOWS, read_rows, stem
from schema.errors import FAILURES
from schema.experiment.document import body_space
from schema.experiment.file import experiment_from_text, read_experiment
from schema.experiment.settings import LATER_WINDOW, evaluation_settings_of
from schema.robot.genome import develop
from schema.tables.last_populations import best_of
from schema.wire.protobuf import decode_genome
from worker.robot.evaluation import evaluate
from worker.robot.robustness import all_changes, rejudge

_GROUPS = (LATER_WINDOW, "time step", "friction", "start")


def missing(data: Path) -> list[tuple[str, int]]:
    """Return experiment and repeat of last populations whose best robot has no row."""
    known = {(row["experiment"], int(row["run"])) for row in csv_rows(data / WINDOWS)}
    stems = sorted(path.stem for path in (data / "final").glob("*.parquet"))
    names = map(_named, stems)
    return [each for each in names if each not in known and each[0] != TOUCHES]


def _named(name: str) -> tuple[str, int]:
    experiment, _, number = name.rpartition("-")
    return experiment, int(number)


def add_row(data: Path, experiment: str, run: int) -> None:
    """Evaluate the best robot of a repeat, and append its row."""
    name = stem(experiment, run)
    rows = read_rows(data, "final", name).to_pylist()
    best = best_of({**row, "island": 0, "birth_island": 0} for row in rows)
    assert best is not None
    (details,) = read_rows(data, "runs", name).to_pylist()
    space = experiment_from_text(details["document"], is_own=True).space
    robot = develop(decode_genome(best["genome"]), body_space(space))
    settings = evaluation_settings_of(read_experiment("scenario1"))
    changes = [one for one in all_changes(settings) if one.group in _GROUPS]
    try:
        found = {SELECTED: evaluate(robot, settings).fitness}
    except FAILURES:
        found = {}
    found |= {change.name: value for change, value in rejudge(robot, changes)
              if value is not None}  # fmt: skip
    columns = (SELECTED, *(change.name for change in changes))
    row = {"experiment": experiment, "run": run, "birth": best["birth"]}
    row["recorded"] = f"{best['fitness']:.6g}"
    values = {key: f"{found[key]:.6g}" if key in found else "" for key in columns}
    append_csv(data / WINDOWS, row | values)


def main() -> None:
    """Evaluate the robots that have no row."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--missing", action="store_true")
    parser.add_argument("--data", type=Path, default=DATA)
    options = parser.parse_args()
    wanted = missing(options.data)
    if options.missing:
        print(f"{len(wanted)} robots have no row")
        return
    for number, each in enumerate(wanted, 1):
        add_row(options.data, *each)
        print(f"{number} of {len(wanted)}: {stem(*each)}", flush=True)


if __name__ == "__main__":
    main()
