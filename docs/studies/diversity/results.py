"""Tables and pictures of the study of diversity, for docs/diversity.md.

    python -m docs.studies.diversity.results page          # write them
    python -m docs.studies.diversity.results page --check  # compare the tables

The rows are those of ``docs.studies.diversity.runs``. The unit is the run. The page
needs a section with the parts ``study runs``, ``study scores`` and ``study best`` as
soon as there are rows.
"""

import sys
from typing import Any

import numpy as np
import pyarrow as pa
from matplotlib import pyplot as plt

from analysis.comparison.statistics import half_interval, mean_difference
from docs.studies.diversity.runs import (
    BIRTHS,
    DATA,
    EXPERIMENTS,
    LATER,
    REFERENCE,
    planned,
)
from docs.studies.pages import PICTURES, Parts, command, csv_rows, markdown

FEWEST = 3
"""Runs without which there is no interval."""
COLOURS = ("#0072B2", "#D55E00", "#009E73", "#CC79A7")
PANELS = {
    "coverage": "share of cells reached",
    "qd_score": "QD score [m/s]",
    "best": "greatest fitness so far [m/s]",
}
SCORES = {
    "coverage": "coverage",
    "qd_score": "QD score",
    "archive_entropy": "archive entropy",
    "diversity": "diversity of the last population",
    "phylogenetic_diversity": "phylogenetic diversity",
}
BEST = {"first": "first window [mm/s]", "later": f"next {LATER} windows [mm/s]"}
Frame = Any  # pandas has no types


def frame(name: str) -> Frame:
    """Return the rows of a file; only those of whole runs."""
    rows = csv_rows(DATA / f"{name}.csv")
    whole = {(row["experiment"], row["seed"]) for row in csv_rows(DATA / "runs.csv")}
    typed = [
        {key: cell if key == "experiment" else float(cell) for key, cell in row.items()}
        for row in rows
        if (row["experiment"], row["seed"]) in whole
    ]
    return pa.Table.from_pylist(typed).to_pandas()


def values(runs: Frame, experiment: str, column: str) -> Any:  # noqa: ANN401 - array
    """Return a column of an experiment's runs."""
    return runs[runs["experiment"] == experiment][column].to_numpy(float)


def with_interval(own: Any, factor: float, form: str) -> str:  # noqa: ANN401 - array
    """Return the mean of runs and, of enough runs, its 95 % interval."""
    middle, low, high = (factor * each for each in mean_difference(own, 0.0))
    ends = f" ({low:{form}} to {high:{form}})" if len(own) >= FEWEST else ""
    return f"{middle:{form}}{ends}"


def ratio(own: Any, reference: Any) -> str:  # noqa: ANN401 - arrays
    """Return the ratio of geometric means with its 95 % interval, by logarithms."""
    if min(len(own), len(reference)) < FEWEST or min(*own, *reference) <= 0:
        return ""
    middle, low, high = np.exp(mean_difference(np.log(own), np.log(reference)))
    return f"{middle:.2f} ({low:.2f} to {high:.2f})"


def scores(runs: Frame) -> list[str]:
    """Return the table of measures of diversity, and of ratios to the reference."""
    rows = []
    for column, text in SCORES.items():
        for name in EXPERIMENTS:
            own = values(runs, name, column)
            against = ratio(own, values(runs, REFERENCE, column))
            shown = "" if name == REFERENCE else against
            if len(own):
                rows.append([text, f"`{name}`", with_interval(own, 1.0, ".3g"), shown])
    heads = ["measure", "experiment", "mean (95 %)", f"over `{REFERENCE}` (95 %)"]
    return markdown(heads, rows)


def best(runs: Frame) -> list[str]:
    """Return the table of the fittest robots in their first and later windows."""
    rows = []
    for name in EXPERIMENTS:
        own = runs[runs["experiment"] == name]
        if len(own):
            cells = [with_interval(own[key].to_numpy(), 1e3, ".0f") for key in BEST]
            against = ratio(
                values(runs, name, "later"), values(runs, REFERENCE, "later")
            )
            shown = "" if name == REFERENCE else against
            rows.append([f"`{name}`", f"{len(own)}", *cells, shown])
    heads = ["experiment", "runs", *BEST.values(), f"later, over `{REFERENCE}` (95 %)"]
    return markdown(heads, rows)


def draw() -> None:
    """Write the picture of courses, if there are runs."""
    if not csv_rows(DATA / "runs.csv"):
        return
    courses = frame("courses")
    figure, axes = plt.subplots(1, len(PANELS), figsize=(10, 3.4), layout="constrained")
    for panel, (column, text) in zip(axes, PANELS.items(), strict=True):
        for name, colour in zip(EXPERIMENTS, COLOURS, strict=True):
            groups = courses[courses["experiment"] == name].groupby("births")[column]
            if not len(groups):
                continue
            mean, counts = groups.mean(), groups.count().to_numpy()
            half = half_interval(groups.std().to_numpy(float), counts)
            panel.plot(mean.index, mean, color=colour, label=name)
            ends = (mean - half, mean + half)
            panel.fill_between(mean.index, *ends, color=colour, alpha=0.18, lw=0)
        panel.set(ylim=(0, None), xlim=(0, courses["births"].max()))
        panel.set_title(text, fontsize=10)
        panel.spines[["top", "right"]].set_visible(False)
    axes[0].legend(frameon=False, fontsize=8)
    figure.supxlabel("births", fontsize=10)
    figure.savefig(PICTURES / "diversity-courses.png", dpi=130)
    plt.close(figure)


def pages() -> dict[str, Parts]:
    """Return the generated parts of the page; none without runs."""
    if not csv_rows(DATA / "runs.csv"):
        return {}
    runs = frame("runs")
    made = f"{len(runs)} of {len([*planned()])} runs of {BIRTHS} births are made."
    parts = {
        "study runs": [made],
        "study scores": scores(runs),
        "study best": best(runs),
    }
    return {"diversity.md": parts}


main = command(__doc__, pages, draw)

if __name__ == "__main__":
    sys.exit(main(None))
