"""Evaluates robots of the campaign in later windows and under changes.

    python -m docs.studies.thesis.windows              # those that have no row yet
    python -m docs.studies.thesis.windows --missing    # count them

The best robot of each last population in docs/data/final is simulated alone, as in
scenario 1, for 60 s in five windows of 12 s; in the first one also under changes of
time step, friction and start. docs/data/windows/robots.csv has one row per robot. Each
takes about five seconds of one core.

All robots of the last populations of off-line experiments, ten runs of each, are
simulated alone for 60 s as well: docs/data/windows/populations.csv has the mean fitness
from 36 s on of each population, which does not depend on the choice of one robot.
"""

import argparse
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from functools import partial
from multiprocessing import get_context
from pathlib import Path
from statistics import fmean
from typing import Any

from msgspec.structs import replace

from analysis.comparison.claims import TOUCHES
from docs.studies.pages import append_csv, csv_rows
from docs.studies.thesis.data import (
    BRIDGES,
    DATA,
    POPULATIONS,
    SELECTED,
    WINDOWS,
    read_rows,
    stem,
)
from schema.agent.supervisor import cores
from schema.errors import FAILURES
from schema.experiment.document import body_space, steps_of
from schema.experiment.file import experiment_from_text, read_experiment
from schema.experiment.settings import LATER_WINDOW, evaluation_settings_of
from schema.robot.genome import develop
from schema.robot.robot import Robot
from schema.tables.last_populations import best_of
from schema.wire.protobuf import decode_genome
from worker.robot.evaluation import evaluate
from worker.robot.robustness import all_changes, rejudge

Row = Mapping[str, Any]
_GROUPS = (LATER_WINDOW, "time step", "friction", "start")
JUDGED = ("scenario1", "scenario2",
          *(name for name in BRIDGES if not name.endswith("warm")))  # fmt: skip
"""Experiments whose whole last populations are evaluated."""
_RUNS = 10
_LATE_S, _END_S = 36.0, 60.0


def missing(data: Path, file: Path = WINDOWS) -> list[tuple[str, int]]:
    """Return experiment and repeat of last populations that have no row in a file."""
    known = {(row["experiment"], int(row["run"])) for row in csv_rows(data / file)}
    stems = sorted(path.stem for path in (data / "final").glob("*.parquet"))
    names = [each for each in map(_named, stems) if each not in known]
    if file == POPULATIONS:
        return [each for each in names if each[0] in JUDGED and each[1] < _RUNS]
    return [each for each in names if each[0] != TOUCHES]


def _named(name: str) -> tuple[str, int]:
    experiment, _, number = name.rpartition("-")
    return experiment, int(number)


def row_of_best(data: Path, each: tuple[str, int]) -> Row:
    """Evaluate the best robot of a repeat, and return its row."""
    experiment, run = each
    name = stem(experiment, run)
    rows = read_rows(data, "final", name).to_pylist()
    best = best_of({**row, "island": 0, "birth_island": 0} for row in rows)
    assert best is not None
    (robot,) = _developed(data, name, [best])
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
    return row | values


def row_of_population(data: Path, each: tuple[str, int]) -> Row:
    """Evaluate the last population of a repeat; return its row; a failure counts 0."""
    experiment, run = each
    rows = read_rows(data, "final", stem(experiment, run)).to_pylist()
    settings = evaluation_settings_of(read_experiment("scenario1"))
    clock = settings.simulation
    late = replace(
        settings,
        simulation=replace(
            clock,
            warmup_steps=steps_of(_LATE_S, clock),
            window_steps=steps_of(_END_S - _LATE_S, clock),
        ),
    )
    found = []
    for robot in _developed(data, stem(experiment, run), rows):
        try:
            found.append(evaluate(robot, late).fitness)
        except FAILURES:
            found.append(0.0)
    row = {"experiment": experiment, "run": run, "robots": len(rows)}
    means = {"recorded": fmean(own["fitness"] for own in rows), "late": fmean(found)}
    values = {key: f"{mean:.6g}" for key, mean in means.items()}
    return row | values


def _developed(data: Path, name: str, rows: Sequence[Row]) -> list[Robot]:
    """Return the robots of some rows of a repeat's last population."""
    (details,) = read_rows(data, "runs", name).to_pylist()
    space = body_space(experiment_from_text(details["document"], is_own=True).space)
    return [develop(decode_genome(row["genome"]), space) for row in rows]


def main() -> None:
    """Evaluate the robots that have no row."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--missing", action="store_true")
    parser.add_argument("--data", type=Path, default=DATA)
    options = parser.parse_args()
    for file, what, row_of in (
        (WINDOWS, "best robots", row_of_best),
        (POPULATIONS, "populations", row_of_population),
    ):
        wanted = missing(options.data, file)
        print(f"{len(wanted)} {what} have no row")
        if options.missing:
            continue
        with ProcessPoolExecutor(cores(), get_context("spawn")) as pool:
            rows = pool.map(partial(row_of, options.data), wanted)
            for number, (each, row) in enumerate(zip(wanted, rows, strict=True), 1):
                append_csv(options.data / file, row)
                print(f"{number} of {len(wanted)}: {stem(*each)}", flush=True)


if __name__ == "__main__":
    main()
