"""Table of the study of remedies of learning, for docs/learning.md.

    python -m docs.studies.learning.results page          # write it
    python -m docs.studies.learning.results page --check  # compare it

The rows are those of ``docs.studies.learning.runs``. The unit is the run.
"""

import sys

import numpy as np

from analysis.comparison.statistics import mean_difference, rank_sum_p
from docs.studies.diversity.results import FEWEST, with_interval
from docs.studies.diversity.runs import LATER, planned
from docs.studies.learning.runs import DATA, EVALUATIONS, EXPERIMENTS, REFERENCE
from docs.studies.pages import Parts, command, csv_rows, markdown

VALUES = {
    "mean": "last population, mean [mm/s]",
    "first": "fittest robot, first window [mm/s]",
    "later": f"next {LATER} windows [mm/s]",
}
Row = dict[str, str]


def numbers(rows: list[Row], name: str, column: str) -> np.ndarray:
    """Return a column of an experiment's runs."""
    return np.array([float(row[column]) for row in rows if row["experiment"] == name])


def against(own: np.ndarray, reference: np.ndarray) -> str:
    """Return difference, 95 % interval and p; nothing of few runs."""
    if min(len(own), len(reference)) < FEWEST:
        return ""
    more, low, high = (1e3 * each for each in mean_difference(own, reference))
    return f"{more:+.0f} ({low:+.0f} to {high:+.0f}), {rank_sum_p(own, reference):.2g}"


def lines() -> list[str]:
    """Return the number of runs, and the table of those that are made."""
    rows = csv_rows(DATA / "runs.csv")
    runs = len([*planned(experiments=EXPERIMENTS)])
    made = f"{len(rows)} of {runs} runs of {EVALUATIONS} evaluations are made."
    cells = []
    for name in EXPERIMENTS:
        count = len(numbers(rows, name, "mean"))
        if count:
            own = {column: numbers(rows, name, column) for column in VALUES}
            more = against(own["later"], numbers(rows, REFERENCE, "later"))
            values = (with_interval(each, 1e3, ".0f") for each in own.values())
            shown = "" if name == REFERENCE else more
            cells.append([f"`{name}`", f"{count}", *values, shown])
    heads = ["", "runs", *VALUES.values(), f"later, more than `{REFERENCE}`, p"]
    return [made, *(["", *markdown(heads, cells)] if cells else [])]


def pages() -> dict[str, Parts]:
    """Return the generated part of the page."""
    return {"learning.md": {"remedies": lines()}}


main = command(__doc__, pages)

if __name__ == "__main__":
    sys.exit(main(None))
