"""Generated parts of docs/results.md about later windows, dates of claims and power."""

import csv
from collections import Counter, defaultdict
from collections.abc import Iterator, Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import plotnine as p9
import pyarrow as pa
from scipy import stats

from analysis.comparison.claims import TOUCHES
from analysis.comparison.findings import LARGE
from analysis.comparison.statistics import (
    alike_power,
    cliffs_delta,
    delta_interval,
    rank_sum_p,
    runs_needed,
)
from analysis.figures.style import in_order, label, ordered, scales, theme_of_size
from analysis.measures.population_table import Numbers
from docs.studies.pages import Parts, csv_rows, markdown
from docs.studies.thesis.data import (
    BRIDGES,
    DATA,
    PARTS,
    POPULATIONS,
    WINDOWS,
    rows_of,
    selection_of,
    windows,
)
from schema.robot.results import sustained

Tables = Mapping[str, pa.Table]
Row = dict[str, Any]

DATES = DATA / "claims.csv"
"""Date at which each claim was committed with its rule."""
WINDOW_S, LATE = 12, 3
"""Length of a window [s]; number of the first window that counts as late."""
_SPANS = [f"{WINDOW_S * at} to {WINDOW_S * (at + 1)} s" for at in range(5)]
_PANELS = {"warm": "warm-up of 12 s", "drawn": "drawn durations",
           "reevaluated": "drawn durations, re-evaluated"}  # fmt: skip
"""Titles of the experiments between off-line and on-line, by the end of their names."""
_THESIS = "as in the thesis"
_STAGES = {
    "2026-11-21": "no row; the margins were chosen on 2026-11-23",
    "2026-11-23": "23 repeats: 7 or 8 of each experiment but scenarios 2 (1) and 3 (0)",
    "2026-11-26": "all 120 off-line repeats and 6 arenas",
    "2026-11-27": "all that is kept here: 120 off-line repeats and 10 arenas",
}
"""What was known when claims were committed, by date."""
_CLOSE = 0.05
ARENA = "scenario3"
"""Recorded fitness there is that of a window among other robots."""
_PLANNED = {name: part.repeats for part in PARTS for name in part.names}


def with_rows(data: Path = DATA) -> list[str]:
    """Return the experiments whose best robots were evaluated in windows, in order."""
    return in_order(row["experiment"] for row in csv_rows(data / WINDOWS))


def late_fitness(experiment: str) -> Numbers:
    """Return the mean fitness of each best robot from 36 s on, (R,)."""
    means: Numbers = windows(DATA, experiment)[:, LATE:].mean(axis=1)
    return means


def parts_of(tables: Tables) -> Parts:
    """Return the generated parts of docs/results.md about later windows."""
    return {
        "windows": _windows(),
        "late": _late(),
        "kept": _kept(tables),
        "stages": _stages(tables),
        "convergence": _convergence(tables),
        "undecided": _undecided(tables),
    }


def _windows() -> list[str]:
    """Return the median fitness in each window, what lasts, and who comes out again."""
    heads = ["experiment", "runs", *_SPANS, "sustained", "recorded fitness again"]
    rows = []
    for name in with_rows():
        found = windows(DATA, name)
        recorded = np.array([float(row["recorded"]) for row in rows_of(DATA, name)])
        share = again = "-"
        at, later = selection_of(name)
        if at is not None:
            shares = [sustained(each[at], each[later:])
                      for each in found.tolist() if each[at] > 0]  # fmt: skip
            share = f"{100 * np.median(np.array(shares, np.float64)):.0f} %"
        if at is not None and name != ARENA:
            is_again = np.abs(found[:, at] - recorded) <= _CLOSE * recorded
            again = f"{is_again.sum()} of {len(found)}"
        medians = (f"{value:.3f}" for value in np.median(found, axis=0))
        rows.append([label(name), str(len(found)), *medians, share, again])
    return markdown(heads, rows)


def _late() -> list[str]:
    """Return comparisons of the fitness from 36 s on, pair by pair."""
    names = with_rows()
    known = {name: late_fitness(name) for name in names}
    pairs = [("scenario3", "scenario1"), ("scenario3", "scenario2"),
             ("scenario3", "no-reproduction"), ("scenario1", "no-reproduction"),
             ("scenario2", "no-reproduction"), ("scenario1", "scenario2")]  # fmt: skip
    new = [name for name in names if name in BRIDGES]
    pairs += [(name, other) for name, other in product(new, ("scenario3",))]
    pairs += [(name, name.partition("-")[0]) for name in new]
    rows = []
    for a, b in pairs:
        if not {a, b} <= known.keys():
            continue
        medians = f"{np.median(known[a]):.3f}; {np.median(known[b]):.3f}"
        compared = _compared(known[a], known[b])
        rows.append([f"{label(a)}, {label(b)}", medians, *compared])
    return markdown(["compared", "medians [m/s]", "Cliff's delta (95 %)", "p"], rows)


def _compared(a: Numbers, b: Numbers) -> list[str]:
    """Return Cliff's delta with its interval, and p, as texts."""
    delta = cliffs_delta(a, b)
    low, high = delta_interval(delta, len(a), len(b))
    return [f"{delta:.2f} ({low:.2f}, {high:.2f})", f"{rank_sum_p(a, b):.2g}"]


def bridges() -> list[str]:
    """Return whether experiments close the gap to scenario 3, for docs/starts.md."""
    rows, known = [], with_rows()
    arenas = late_fitness(ARENA)
    for name in ("scenario1", "scenario2", *BRIDGES):
        if name not in known:
            rows.append([f"`{name}`", "0", "not measured yet", "", ""])
            continue
        own = late_fitness(name)
        delta = cliffs_delta(own, arenas)
        low, high = delta_interval(delta, len(own), len(arenas))
        no = "no" if high < 0 else "undecided"
        rows.append(
            [
                f"`{name}`",
                str(len(own)),
                f"{np.median(own):.3f}",
                f"{delta:.2f} ({low:.2f}, {high:.2f})",
                "yes" if low > -LARGE else no,
            ]
        )
    heads = ["experiment", "runs", "median from 36 s on [m/s]",
             "Cliff's delta over scenario 3 (95 %)", "closes the gap"]  # fmt: skip
    return markdown(heads, rows)


def populations() -> list[str]:
    """Return the mean fitness of last populations from 36 s on, for docs/starts.md."""
    rows, means = [], defaultdict[str, list[float]](list)
    for row in csv_rows(DATA / POPULATIONS):
        means[row["experiment"]].append(float(row["late"]))
    for name in in_order(means):
        own, base = np.array(means[name]), np.array(means[name.partition("-")[0]])
        cells = ["", ""]
        if name in BRIDGES:
            cells = _compared(own, base)
        rows.append([f"`{name}`", str(len(own)), f"{np.median(own):.3f}", *cells])
    heads = ["experiment", "runs", "median of populations' means [m/s]",
             "Cliff's delta over scenario 1 or 2 (95 %)", "p"]  # fmt: skip
    return markdown(heads, rows)


def _kept(tables: Tables) -> list[str]:
    """Return what best robots keep and sustain, means over runs."""
    outcomes = tables["outcomes"].to_pandas()
    texts = {"sustained": "sustained in later windows",
             "kept_fitness": "kept under changes of time step, friction and start",
             "later_fitness": "fitness in later windows [m/s]"}  # fmt: skip
    rows = []
    for name in with_rows():
        mine = outcomes[outcomes["experiment"] == name]
        cells = []
        for measure in texts:
            values = mine[measure].dropna()
            low, middle, high = values.quantile([0.25, 0.5, 0.75])
            cells.append(
                f"{middle:.3f} ({low:.3f}, {high:.3f})" if len(values) else "-"
            )
        rows.append([label(name), *cells])
    return markdown(["median (quartiles) of best robots", *texts.values()], rows)


def key_of(row: Mapping[str, Any]) -> tuple[str, ...]:
    """Return what names a claim: figure, measure, experiments, direction, text."""
    names = ("figure", "measure", "a", "b", "expected", "text")
    return tuple(str(row[name]) for name in names)


def dates() -> dict[tuple[str, ...], str]:
    """Return the date of each claim."""
    with DATES.open(newline="", encoding="utf-8") as rows:
        return {key_of(row): row["date"] for row in csv.DictReader(rows)}


def _stages(tables: Tables) -> list[str]:
    """Return verdicts by the date at which claims were fixed."""
    known = dates()
    counts: dict[str, Counter[str]] = {date: Counter() for date in _STAGES}
    for row in tables["findings"].to_pylist():
        counts[known[key_of({**row, "text": row["claim"]})]][row["verdict"]] += 1
    verdicts = ("reproduced", "not reproduced", "undecided")
    rows = [
        [date, text, str(own.total()), *(str(own[verdict]) for verdict in verdicts)]
        for (date, text), own in zip(_STAGES.items(), counts.values(), strict=True)
    ]
    return markdown(["fixed", "rows that were kept then", "findings", *verdicts], rows)


def _convergence(tables: Tables) -> list[str]:
    """Return the rank correlation of diversity and fitness at the end, over runs."""
    outcomes = tables["outcomes"].to_pandas()
    rows = []
    for name in ("scenario1", "scenario2", "scenario3"):
        mine = outcomes[outcomes["experiment"] == name]
        last = mine[mine["births"] == mine["births"].max()]
        found = stats.spearmanr(last["diversity"], last["fitness"])
        numbers = f"{found.statistic:+.2f}", f"{found.pvalue:.2g}"
        rows.append([label(name), str(len(last)), *numbers])
    return markdown(["experiment", "runs", "rank correlation", "p"], rows)


def _undecided(tables: Tables) -> Iterator[str]:
    """Yield which undecided findings more arenas can decide."""
    rows = [row for row in tables["findings"].to_pylist()
            if row["verdict"] == "undecided" and row["runs_a"] is not None]  # fmt: skip
    arenas = [row for row in rows if "scenario3" in (row["a"], row["b"])]
    yield (
        f"Of {len(rows)} undecided findings {len(rows) - len(arenas)} are not about "
        "scenario 3: no further arena decides them. "
        f"{len(arenas)} are about scenario 3:"
    )
    planned = _PLANNED["scenario3"]
    pairs = [row for row in arenas if row["b"]]
    alike = [row for row in pairs if row["expected"] == "="]
    power = alike_power(planned, planned, LARGE)
    if alike:
        yield (
            f"- {len(alike)} say that two experiments differ by less than a large "
            f"effect. With {planned} arenas the power of the test is {power:.2f} if "
            "they do not differ at all."
        )
    needs = {row["claim"]: runs_needed(row["effect"]) for row in pairs
             if row["expected"] != "="}  # fmt: skip
    enough = [need for need in needs.values() if need and need <= planned]
    yield (
        f"- {len(needs)} say that one experiment has more. {len(enough)} of them would "
        f"need at most {planned} runs of each if the effect is as seen (before the "
        "correction); the others need more."
    )
    yield f"- {len(arenas) - len(pairs)} compare scenario 3 with a number."


def topics(rows: Sequence[Row]) -> str:
    """Return how many topics are wholly reproduced."""
    groups: dict[tuple[str, str, str], set[str]] = {}
    for row in rows:
        key = row["figure"], row["topic"], row["expected"]
        groups.setdefault(key, set()).add(row["verdict"])
    whole = sum(verdicts == {"reproduced"} for verdicts in groups.values())
    return f"By topic: {whole} of {len(groups)} are reproduced in all their pairs."


def windows_figure(tables: Tables) -> p9.ggplot:
    """Return median fitness and quartiles of best robots over windows."""
    frame = tables["windows"].to_pandas()
    grouped = frame.groupby(["panel", "experiment", "window"])["fitness"]
    shown = grouped.quantile([0.25, 0.5, 0.75]).unstack()
    shown = shown.set_axis(["low", "middle", "high"], axis=1).reset_index()
    panels = frame["panel"].unique().tolist()
    shown["panel"] = ordered(shown["panel"], panels)
    labels = [f"{WINDOW_S * n}-{WINDOW_S * (n + 1)}" for n in range(5)]
    return (
        p9.ggplot(shown, p9.aes("window", "middle"))
        + p9.geom_ribbon(p9.aes(ymin="low", ymax="high", fill="experiment"), alpha=0.15)
        + p9.geom_line(p9.aes(colour="experiment"), size=0.9)
        + p9.geom_point(p9.aes(colour="experiment"), size=1.8)
        + p9.facet_wrap("panel", ncol=2)
        + scales(tables, shown["experiment"])
        + p9.scale_x_continuous(breaks=list(range(5)), labels=labels)
        + p9.expand_limits(y=0)
        + p9.labs(x="window [s]", y="fitness of the best robot [m/s]")
        + theme_of_size(1.5 + 2.4 * -(-len(panels) // 2))
    )


def rows_of_windows(data: Path = DATA) -> pa.Table:
    """Return one row per best robot and window in each panel of the figure."""
    names = [name for name in with_rows(data) if name != TOUCHES]
    shown = [(_THESIS, name, name) for name in names if name not in BRIDGES]
    for kind, title in _PANELS.items():
        own = [name for name in BRIDGES if name in names and name.endswith(kind)]
        shown += [(title, name, name.partition("-")[0]) for name in own]
        shown += [(title, ARENA, ARENA)] * bool(own)
    rows = [
        {"panel": panel, "experiment": base, "window": at, "fitness": value}
        for panel, name, base in shown
        for values in windows(data, name)
        for at, value in enumerate(values.tolist())
    ]
    return pa.Table.from_pylist(rows)
