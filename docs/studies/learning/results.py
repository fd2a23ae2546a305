"""Table of the study of remedies of learning, for docs/learning.md.

    python -m docs.studies.learning.results page          # write it
    python -m docs.studies.learning.results page --check  # compare it

The rows are those of ``docs.studies.learning.runs``. The unit is the run.
"""

import sys

import matplotlib.pyplot as plt
import numpy as np

from analysis.comparison.statistics import mean_difference, rank_sum_p
from docs.studies.diversity.results import FEWEST, with_interval
from docs.studies.diversity.runs import LATER, planned
from docs.studies.learning.runs import DATA, EVALUATIONS, EXPERIMENTS, REFERENCE
from docs.studies.pages import PICTURES, Parts, command, csv_rows, markdown

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


def draw() -> None:
    """Write the picture of the fittest robots in their first and later windows."""
    rows = csv_rows(DATA / "runs.csv")
    figure, panel = plt.subplots(figsize=(7.2, 3.2), layout="constrained")
    shown = (
        ("first", "first window", "#b8b8b8", -0.17),
        ("later", f"next {LATER} windows", "#0072b2", 0.17),
    )
    for column, label, colour, shift in shown:
        for place, name in enumerate(EXPERIMENTS):
            own = 1e3 * numbers(rows, name, column)
            if len(own):
                at = np.full(len(own), place + shift)
                panel.plot(own, at, "o", color=colour, alpha=0.55, ms=5, mew=0)
                panel.plot(own.mean(), place + shift, "|", color="black", ms=11, mew=2)
        panel.plot([], [], "o", color=colour, mew=0, label=label)
    panel.set(xlim=(0, None), xlabel="fitness of the fittest robot [mm/s]; bars: means")
    panel.set_yticks(range(len(EXPERIMENTS)), EXPERIMENTS)
    panel.invert_yaxis()
    panel.spines[["top", "right"]].set_visible(False)
    panel.legend(frameon=False, fontsize=9)
    figure.savefig(PICTURES / "learning-remedies.png", dpi=130)
    plt.close(figure)


def pages() -> dict[str, Parts]:
    """Return the generated part of the page."""
    return {"learning.md": {"remedies": lines()}}


main = command(__doc__, pages, draw)

if __name__ == "__main__":
    sys.exit(main(None))
