"""Tables and pictures of the study of the ecosystem, for docs/ecosystem.md.

    python -m docs.studies.ecosystem.results page          # write them
    python -m docs.studies.ecosystem.results page --check  # compare the tables

The rows are those of ``docs.studies.ecosystem.runs``. The unit is the run. A run and
its neutral twin have the same founders: their difference is taken seed by seed.
"""

import sys
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from statistics import median
from typing import Any

import numpy as np
import pyarrow as pa
from matplotlib import pyplot as plt
from scipy import stats

from analysis.comparison.statistics import mean_difference, signed_rank
from docs.studies.ecosystem.runs import (
    COSTS,
    COURSES,
    END_S,
    GAINS,
    INFLOWS,
    INTAKES,
    ROBOTS,
    RUNS,
    missing,
    planned,
)
from docs.studies.pages import PICTURES, Parts, command, csv_rows, markdown

LIMIT, PATCHES = 60, 4
"""Of the shipped experiment: most robots, and number of patches."""
FEWEST = 3
"""Runs or robots without which there is no interval, or no correlation."""
TEXTS = {"part", "reason"}
LATE = {
    "intake_per_s": "energy taken [1/s]",
    "in_patches": "share of time in patches",
    "straight_velocity": "displacement velocity [mm/s]",
    "path_velocity": "path velocity [mm/s]",
    "work_w": "motor work [mW]",
    "children": "children",
    "parts": "parts",
    "motors": "motors",
}
"""What is compared of robots born in the second half, with the names in the table."""
TIMES_1000 = {"straight_velocity", "path_velocity", "work_w"}
CORRELATED = ("intake_per_s", "in_patches", "straight_velocity", "work_w", "parts")
"""Measures with which children per robot are correlated, over robots that died."""
COLOURS = ("#0072B2", "#D55E00")
"""Of runs that survive, and of those that die out."""
Frame = Any  # pandas has no types
Measure = Callable[[Frame], float]


def frame(file: Any) -> Frame:  # noqa: ANN401 - a path
    """Return a file of rows; empty cells are NaN."""
    rows = [
        {
            name: cell if name in TEXTS else float(cell or "nan")
            for name, cell in row.items()
        }
        for row in csv_rows(file)
    ]
    return pa.Table.from_pylist(rows).to_pandas()


def survival(runs: Frame) -> list[str]:
    """Return cells: runs, extinct ones, survival, population, share at the limit."""
    if runs.empty:
        return ["0", "", "", "", ""]
    return [
        f"{len(runs)}",
        f"{runs['is_extinct'].sum():.0f}",
        f"{median(runs['survived_s']):.0f}",
        with_interval(runs["population"].to_numpy(), ".1f"),
        f"{100 * runs['at_limit'].mean():.0f} %",
    ]


HEADS = (
    "runs",
    "died out",
    "median survival [s]",
    "population of the last 600 s (95 %)",
    "time at the limit",
)


def with_interval(values: Any, form: str) -> str:  # noqa: ANN401 - an array
    """Return a mean of runs and its 95 % interval, if it has one."""
    if not len(values):
        return ""
    middle, low, high = mean_difference(values.astype(float), 0.0)
    ends = f" ({low:{form}} to {high:{form}})"
    is_known = len(values) >= FEWEST and np.isfinite(low)
    return f"{middle:{form}}" + (ends if is_known else "")


def sweep(runs: Frame, part: str, head: str, values: Sequence[float]) -> list[str]:
    """Return the table of a part with one swept setting."""
    of_part = runs[runs["part"] == part]
    rows = [
        [f"{value:g}", *survival(of_part[of_part["first"] == value])]
        for value in values
    ]
    return markdown([head, *HEADS], rows)


def chemostat(runs: Frame) -> list[str]:
    """Return the table over inflow and cost of living."""
    of_part = runs[runs["part"] == "chemostat"]
    rows = []
    for inflow in INFLOWS:
        for cost in COSTS:
            chosen = (of_part["first"] == inflow) & (of_part["second"] == cost)
            fed = f"{PATCHES * inflow / cost:.0f}"
            rows.append([f"{inflow:g}", f"{cost:g}", fed, *survival(of_part[chosen])])
    return markdown(["`patch_inflow`", "`energy_per_s`", "fed", *HEADS], rows)


def starts(runs: Frame) -> list[str]:
    """Return the table of random founders and of those that walk."""
    names = {"control": "random", "walkers": "walk"}
    rows = [
        [text, *survival(runs[(runs["part"] == part)])] for part, text in names.items()
    ]
    return markdown(["founders", *HEADS], rows)


def measures() -> Mapping[str, tuple[str, Measure]]:
    """Return a function of the robots of a run for each row of the table."""
    rows: dict[str, tuple[str, Measure]] = {
        name: (text, partial(_late, name)) for name, text in LATE.items()
    }
    return rows | {
        f"children {name}": (
            f"children ~ {LATE[name].partition(' [')[0]}",
            partial(_correlation, name),
        )
        for name in CORRELATED
    }


def _late(name: str, robots: Frame) -> float:
    late = robots[(robots["born_s"] > END_S / 2) & (robots["is_founder"] == 0)]
    factor = 1000.0 if name in TIMES_1000 else 1.0
    return factor * float(late[name].mean())


def _correlation(name: str, robots: Frame) -> float:
    dead = robots[robots["reason"] != ""]
    known = dead[["children", name]].dropna()
    if len(known) < FEWEST or known.nunique().min() == 1:
        return float("nan")
    return float(stats.spearmanr(known["children"], known[name]).statistic)


def pairs(robots: Frame, measure: Measure) -> Any:  # noqa: ANN401 - an array
    """Return a measure of each run and its twin, (S, 2), without NaN."""
    values = [
        [measure(robots[(robots["part"] == part) & (robots["seed"] == seed)])
         for part in ("control", "neutral")]
        for seed in sorted(robots["seed"].unique())
    ]  # fmt: skip
    both = np.array(values, float).reshape(-1, 2)
    return both[np.isfinite(both).all(axis=1)]


def control(robots: Frame) -> list[str]:
    """Return the table of the ecosystem against its neutral twins."""
    rows = []
    for text, measure in measures().values():
        both = pairs(robots, measure)
        if len(both) < FEWEST:
            rows.append([text, str(len(both)), "", "", "", "", ""])
            continue
        own, twin = both.T
        effect, p = signed_rank(own - twin)
        difference = with_interval(own - twin, "+.3f")
        rows.append(
            [text, f"{len(both)}", f"{own.mean():.3f}", f"{twin.mean():.3f}",
             difference, f"{effect:+.2f}", f"{p:.3f}"]
        )  # fmt: skip
    heads = ["measure", "pairs", "ecosystem", "neutral", "difference (95 %)", "effect",
             "p"]  # fmt: skip
    return markdown(heads, rows)


def draw_sweeps(courses: Frame, runs: Frame) -> None:
    """Write the picture of populations without bounded inflow."""
    figure, axes = plt.subplots(
        2, len(GAINS), figsize=(10, 4.2), sharex=True, sharey=True, layout="constrained"
    )
    for row, (part, values) in enumerate((("gain", GAINS), ("zones", INTAKES))):
        word = "gain" if part == "gain" else "intake"
        for panel, value in zip(axes[row], values, strict=True):
            _populations(panel, courses, runs, (part, value, 0.0))
            panel.set_title(f"{word} {value:g}", fontsize=9)
    _finish(figure, axes, "ecosystem-unbounded")


def draw_chemostat(courses: Frame, runs: Frame) -> None:
    """Write the picture of populations over inflow and cost of living."""
    figure, axes = plt.subplots(
        len(INFLOWS), len(COSTS), figsize=(10, 7), sharex=True, sharey=True,
        layout="constrained",
    )  # fmt: skip
    for row, inflow in zip(axes, INFLOWS[::-1], strict=True):
        for panel, cost in zip(row, COSTS, strict=True):
            _populations(panel, courses, runs, ("chemostat", inflow, cost))
            fed = PATCHES * inflow / cost
            if fed <= LIMIT:
                panel.axhline(fed, color="#7F7F7F", lw=0.8, ls=":")
            panel.set_title(f"inflow {inflow:g}, cost {cost:g}", fontsize=9)
    _finish(figure, axes, "ecosystem-chemostat")


def _populations(
    panel: Any,  # noqa: ANN401 - Matplotlib
    courses: Frame,
    runs: Frame,
    names: tuple[str, float, float],
) -> None:
    columns = ["part", "first", "second"]
    of_runs, lines = (
        rows[(rows[columns] == [*names]).all(axis=1)] for rows in (runs, courses)
    )
    extinct = dict(zip(of_runs["seed"], of_runs["is_extinct"], strict=True))
    for seed, line in lines.groupby("seed"):
        minutes = line["sim_time_s"] / 60
        colour = COLOURS[int(extinct.get(seed, 0))]
        panel.plot(minutes, line["population"], color=colour, lw=0.9, alpha=0.8)
    panel.axhline(LIMIT, color="#7F7F7F", lw=0.8, ls="--")
    panel.spines[["top", "right"]].set_visible(False)


def _finish(figure: Any, axes: Any, name: str) -> None:  # noqa: ANN401 - Matplotlib
    axes[0, 0].set(ylim=(0, LIMIT + 4), xlim=(0, END_S / 60))
    figure.supxlabel("simulated time [min]", fontsize=10)
    figure.supylabel("living robots", fontsize=10)
    figure.savefig(PICTURES / f"{name}.png", dpi=120)
    plt.close(figure)


def draw_control(robots: Frame) -> None:
    """Write the picture of differences from the neutral twins, in their deviations."""
    figure, panel = plt.subplots(figsize=(7, 4), layout="constrained")
    shown = [
        (text, own - twin)
        for text, measure in measures().values()
        for own, twin in [pairs(robots, measure).T]
        if len(own) >= FEWEST and np.ptp(own - twin)
    ]
    for row, (_, differences) in enumerate(reversed(shown)):
        scaled = differences / differences.std(ddof=1)
        middle, low, high = mean_difference(scaled, 0.0)
        panel.plot(scaled, [row] * len(scaled), "o", color="#BBBBBB", ms=3)
        panel.plot([low, high], [row, row], color=COLOURS[0], lw=2)
        panel.plot(middle, row, "o", color=COLOURS[0], ms=6)
    panel.set_yticks(range(len(shown)), [text for text, _ in reversed(shown)])
    panel.axvline(0.0, color="#333333", lw=0.8)
    figure.supxlabel("ecosystem minus its neutral twin [standard deviations]")
    panel.spines[["top", "right", "left"]].set_visible(False)
    figure.savefig(PICTURES / "ecosystem-control.png", dpi=120)
    plt.close(figure)


def draw() -> None:
    """Write the pictures."""
    courses, runs = frame(COURSES), frame(RUNS)
    draw_sweeps(courses, runs)
    draw_chemostat(courses, runs)
    draw_control(frame(ROBOTS))


def pages() -> dict[str, Parts]:
    """Return the generated parts of the page."""
    runs = frame(RUNS)
    wanted = len([*planned()])
    made = wanted - len(missing(None))
    return {
        "ecosystem.md": {
            "study runs": [f"{made} of {wanted} runs are made."],
            "study gain": sweep(runs, "gain", "`mating_gain`", GAINS),
            "study zones": sweep(runs, "zones", "`intake_per_s`", INTAKES),
            "study chemostat": chemostat(runs),
            "study starts": starts(runs),
            "study control": control(frame(ROBOTS)),
        }
    }


main = command(__doc__, pages, draw)

if __name__ == "__main__":
    sys.exit(main(None))
