"""First screen of the report: what the experiments did, and how they differ."""

from collections.abc import Mapping, Sequence
from html import escape
from statistics import mean
from typing import Any

import pyarrow as pa
import pyarrow.compute as pc

from analysis.figures.style import colours, in_order, label
from analysis.measures.outputs import OUTCOME
from analysis.report.fitness import run_names
from analysis.report.html import cell, duration, folded, number, plural, table

Tables = Mapping[str, pa.Table]
Row = Mapping[str, Any]

_MOST_PAIRS = 3
"""Pairs of experiments on the first screen, those with the smallest p."""
_COMPARED = {
    "fitness": "Difference of mean fitness",
    "fitness_best": "Difference of best fitness",
}
_SURE = 2
"""Runs of both experiments from which on their difference has an interval."""


def summary(tables: Tables) -> str:
    """Return one row per experiment: runs, births, fitness, time, failures.

    Args:
        tables: ``runs`` and ``populations``.
    """
    runs = tables["runs"].to_pylist()
    fitness = _last_fitness(tables["populations"])
    names = in_order(row["experiment"] for row in runs)
    paint = colours(names)
    has_settings = any(row["differs"] for row in runs)
    heads = ["experiment", "runs", "births of a run", "best fitness", "mean fitness"]
    heads += ["time of a run", "failures", *(["settings"] if has_settings else [])]
    rows = []
    for name in names:
        mine = [row for row in runs if row["experiment"] == name]
        known = [fitness[row["folder"]] for row in mine if row["folder"] in fitness]
        times = [row["duration_s"] for row in mine if row["duration_s"] is not None]
        failures = [row["failures"] for row in mine if row["failures"] is not None]
        births = sorted({row["births"] for row in mine})
        mark = f'<i style="background:{paint[name]}"></i>'
        cells = [
            f'<td class="name">{mark}{escape(label(name))}</td>',
            cell(_states(mine)),
            cell(
                str(births[0]) if len(births) == 1 else f"{births[0]} to {births[-1]}"
            ),
            cell(max((best for best, _ in known), default=None)),
            cell(mean(each for _, each in known) if known else None),
            cell(duration(mean(times) if times else None)),
            cell(sum(failures) if failures else None),
            *([cell(mine[0]["differs"] or "")] if has_settings else []),
        ]
        rows.append(cells)
    return table(heads, rows) + _summary_note(runs) if rows else ""


def _states(runs: Sequence[Row]) -> str:
    # A folder does not say whether its run is still being executed.
    finished = [row["state"] == "finished" for row in runs].count(True)
    counts = {"finished": finished, "not finished": len(runs) - finished}
    return ", ".join(f"{count} {state}" for state, count in counts.items() if count)


def _summary_note(runs: Sequence[Row]) -> str:
    functions = in_order(row["function"] for row in runs if row["function"])
    text = (
        "Fitness is that of the last populations: of their best robot, and the mean "
        "over runs of their means"
    )
    if functions:
        text += f"; fitness function {', '.join(functions)}"
    return f'<p class="note">{escape(text)}.</p>'


def _last_fitness(populations: pa.Table) -> dict[str, tuple[float, float]]:
    """Return best and mean fitness of the last populations of each run, by folder."""
    judged = populations.filter(pc.field("fitness").is_valid())
    keys = ["folder", "island"]
    last = judged.group_by(keys).aggregate([("births", "max")])
    rows = judged.join(last, keys).filter(pc.field("births") == pc.field("births_max"))
    islands: dict[str, list[tuple[float, float]]] = {}
    for row in rows.to_pylist():
        both = row["fitness_best"], row["fitness"]
        islands.setdefault(row["folder"], []).append(both)
    return {
        folder: (max(best for best, _ in each), mean(value for _, value in each))
        for folder, each in islands.items()
    }


def differences(tables: Tables) -> str:
    """Return the differences of fitness between experiments, with intervals.

    Args:
        tables: ``comparison`` and ``runs``.

    Returns:
        HTML; empty if there is one experiment.
    """
    if len(set(tables["runs"]["experiment"].to_pylist())) <= 1:
        return ""
    parts = [_differences_of(tables["comparison"], *one) for one in _COMPARED.items()]
    if not any(parts):
        return (
            "<h3>Comparison</h3><p>Nothing is compared: fewer than two experiments "
            "have a finished run with a population.</p>"
        )
    note = (
        '<p class="note">Dot: difference of the means over finished runs; bar: its '
        "95 % interval (Welch); thin line: no difference. All measures are in "
        '<a href="#comparison">Comparison</a>.</p>'
    )
    return "".join(parts) + note


def _differences_of(comparison: pa.Table, measure: str, title: str) -> str:
    """Return the differences of one measure; empty if nothing is compared."""
    rows = comparison.filter(pc.field("measure") == measure).to_pylist()
    rows.sort(key=lambda row: row["p"])
    shown = rows[:_MOST_PAIRS]
    if not shown:
        return ""
    ends = [row["difference"] for row in shown]
    ends += [end for row in shown if (both := _interval(row)) for end in both]
    reach = max(map(abs, ends)) or 1.0
    more = f", {len(shown)} of {len(rows)} pairs" * (len(rows) > len(shown))
    lines = [_difference(row, reach) for row in shown]
    return f"<h3>{title}{more}</h3>{''.join(lines)}"


def _interval(row: Row) -> tuple[float, float] | None:
    """Return the interval of a difference; None without two runs of each."""
    low, high = row["difference_low"], row["difference_high"]
    if low is None or min(row["runs_a"], row["runs_b"]) < _SURE:
        return None
    return low, high


def _difference(row: Row, reach: float) -> str:
    """Return a difference in words and as a bar from ``-reach`` to ``reach``."""
    a, b = (f"<b>{escape(label(row[name]))}</b>" for name in "ab")
    both = _interval(row)
    counts = f"{row['runs_a']} and {plural(row['runs_b'], 'run')}"
    at = f"{counts}, at {row['births']} births"
    sign = "+" * (row["difference"] > 0)
    value = f"<b>{sign}{number(row['difference'])}</b>"
    if both is None:
        verdict = "no interval: it needs two finished runs of each (--repeats)"
        text = f"{value} ({at})"
    else:
        low, high = both
        text = (
            f"{value}, 95 % interval {number(low)} to {number(high)} ({at}; "
            f"p = {number(row['p'])})"
        )
        verdict = "the interval includes 0: no difference is shown"
        if low > 0 or high < 0:
            higher = row["a"] if low > 0 else row["b"]
            verdict = f"{label(higher)} is fitter: the interval excludes 0"
    return (
        f'<div class="difference"><p>{a} minus {b}: {text}<br>'
        f'<span class="verdict">{escape(verdict)}</span></p>'
        f"{_bar(row['difference'], both, reach)}</div>"
    )


def _bar(value: float, both: tuple[float, float] | None, reach: float) -> str:
    def at(number: float) -> float:
        return 200 + 190 * number / reach

    interval = ""
    if both is not None:
        interval = (
            f'<path class="interval" d="M{at(both[0]):.1f} 12H{at(both[1]):.1f}"/>'
        )
    return (
        '<svg class="bar" viewBox="0 0 400 24" role="img" aria-label="interval">'
        f'<path class="zero" d="M200 0V24"/>{interval}'
        f'<circle cx="{at(value):.1f}" cy="12" r="5"/></svg>'
    )


def all_differences(tables: Tables) -> str:
    """Return a folded table of all measures for each pair of experiments.

    Args:
        tables: ``comparison``.
    """
    pairs: dict[tuple[str, str], list[Row]] = {}
    for row in tables["comparison"].to_pylist():
        pairs.setdefault((row["a"], row["b"]), []).append(row)
    columns = ("mean_a", "mean_b", "difference", "difference_low", "difference_high",
               "effect", "p", "q")  # fmt: skip
    folds = []
    for (a, b), mine in pairs.items():
        heads = ("measure", label(a), label(b), "difference", "low", "high", "effect",
                 "p", "q")  # fmt: skip
        rows = []
        for row in mine:
            known = row if _interval(row) else {**row, "difference_low": None,
                                                "difference_high": None}  # fmt: skip
            name = row["measure"]
            first = f'<td title="{escape(OUTCOME[name])}">{name.replace("_", " ")}</td>'
            rows.append([first, *(cell(known[column]) for column in columns)])
        title = (
            f"{label(a)} ({plural(mine[0]['runs_a'], 'run')}) and {label(b)} "
            f"({plural(mine[0]['runs_b'], 'run')}) at {mine[0]['births']} births"
        )
        folds.append(folded(title, table(heads, rows)))
    if not folds:
        return ""
    note = (
        "Means over finished runs; low and high are the ends of the difference's 95 % "
        "interval. The effect is Cliff's delta: how much more often a run of the first "
        "experiment is above one of the second than below. q is p, corrected for all "
        "tests of this section. The pointer on a measure shows its meaning."
    )
    return f'<p class="note">{escape(note)}</p>{"".join(folds)}'


def all_runs(tables: Tables) -> str:
    """Return one row per run.

    Args:
        tables: ``runs`` and ``populations``.
    """
    fitness = _last_fitness(tables["populations"])
    names = run_names(tables["runs"])
    rows = []
    for row in tables["runs"].to_pylist():
        best, average = fitness.get(row["folder"], (None, None))
        cells = (label(names[row["folder"]].experiment), row["run"], row["seed"],
                 row["state"], row["births"], row["islands"], best, average,
                 duration(row["duration_s"]), row["failures"],
                 row["folder"])  # fmt: skip
        rows.append([cell(value) for value in cells])
    heads = ("experiment", "run", "seed", "state", "births", "islands", "best fitness",
             "mean fitness", "time", "failures", "folder")  # fmt: skip
    return table(heads, rows)


def speed(tables: Tables) -> str:
    """Return the births per second of each experiment's runs.

    Args:
        tables: ``runs``.
    """
    rows = []
    runs = [row for row in tables["runs"].to_pylist() if row["duration_s"]]
    for name in in_order(row["experiment"] for row in runs):
        mine = [row for row in runs if row["experiment"] == name]
        rates = [row["births"] / row["duration_s"] for row in mine]
        times = [duration(each(r["duration_s"] for r in mine)) for each in (min, max)]
        spans = times[0] if len(mine) == 1 else f"{times[0]} to {times[1]}"
        cells = (label(name), len(mine), spans, mean(rates))
        rows.append([cell(value) for value in cells])
    if not rows:
        return ""
    note = (
        "Time from a run's start to its end, pauses included; runs of a campaign share "
        "the workers."
    )
    heads = ("experiment", "ended runs", "time of a run", "births per second of a run")
    return f"{table(heads, rows)}<p class=note>{escape(note)}</p>"
