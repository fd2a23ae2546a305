"""Differences of fitness and of all measures between experiments."""

from collections.abc import Collection, Sequence
from html import escape
from math import comb

from analysis.figures.forms import Row, Tables
from analysis.figures.style import label
from analysis.measures.fitness_functions import measured_apart, not_compared
from analysis.measures.outputs import OUTCOME, meaning
from analysis.report.html import capitalised, cell, folded, number, table
from schema.errors import counted

_MOST_PAIRS = 3
"""Pairs of experiments on the first screen, those with the smallest p."""
_COMPARED = {
    "fitness": "Difference of mean fitness",
    "fitness_best": "Difference of the mean of bests",
}
_LEVEL = 0.05
"""Greatest p of a difference that counts as shown."""
_SURE = 2
"""Runs of both experiments from which on their difference has an interval."""


def differences(tables: Tables) -> str:
    """Return the differences of fitness between experiments; empty for one."""
    if len(set(tables["runs"]["experiment"].to_pylist())) <= 1:
        return ""
    online, offline = map(set, measured_apart(tables["runs"]))
    every = tables["comparison"].to_pylist()
    # A pair of an experiment in arenas and one off-line comes last.
    for row in every:
        pair = {row["a"], row["b"]}
        row["apart"] = not (online.isdisjoint(pair) or offline.isdisjoint(pair))
    # Both measures show the same pairs in the same order.
    known = {(row["a"], row["b"]): row["p"] for row in every
             if row["measure"] == "fitness" and row["p"] is not None}  # fmt: skip
    every.sort(key=lambda row: (row["apart"], known.get((row["a"], row["b"]), 1.0)))
    parts = [_differences_of(every, *titled) for titled in _COMPARED.items()]
    apart = _apart(tables)
    if not any(parts):
        why = apart or (
            "<p>Nothing is compared: fewer than two experiments have a finished run "
            "with a population.</p>"
        )
        return f"<h3>Comparison of fitness</h3>{why}"
    note = (
        '<p class="note">Dot: difference of the means over finished runs. Bar: its '
        "95 % interval (Welch's t, which is about means). p: exact rank-sum test, "
        "which is about how often a run of one experiment is fitter than one of the "
        "other. A difference is shown if the interval excludes 0 and p < 0.05. The "
        'meaning of all columns is in <a href="#comparison">Comparison</a>.</p>'
    )
    return "".join(parts) + apart + note


def _apart(tables: Tables) -> str:
    """Return why fitness cannot be compared in some pairs; empty if it can in all."""
    lines = not_compared(tables["runs"], label)
    return "".join(f"<p>{escape(capitalised(line))}.</p>" for line in lines)


def _differences_of(comparison: Sequence[Row], measure: str, title: str) -> str:
    rows = [row for row in comparison if row["measure"] == measure]
    shown = rows[:_MOST_PAIRS]
    if not shown:
        return ""
    ends = [row["difference"] for row in shown]
    ends += [end for row in shown if (both := interval(row)) for end in both]
    reach = max(map(abs, ends)) or 1.0
    more = f", {len(shown)} of {len(rows)} pairs" * (len(rows) > len(shown))
    lines = [_difference(row, reach) for row in shown]
    return f"<h3>{title}{more}</h3>{''.join(lines)}"


def interval(row: Row) -> tuple[float, float] | None:
    """Return the interval of a difference; None without two runs of each.

    Fewer than ten equal runs have none either.
    """
    low, high = row["difference_low"], row["difference_high"]
    if low is None or min(row["runs_a"], row["runs_b"]) < _SURE:
        return None
    return low, high


def _difference(row: Row, reach: float) -> str:
    """Return a difference in words and as a bar from ``-reach`` to ``reach``."""
    a, b = (f"<b>{escape(label(row[name]))}</b>" for name in "ab")
    both = interval(row)
    has_two = min(row["runs_a"], row["runs_b"]) >= _SURE
    is_tested = has_two and row["p"] is not None
    p = f"; rank-sum p = {number(row['p'])}" * is_tested
    sign = "+" * (row["difference"] > 0)
    text = f"<b>{sign}{number(row['difference'])}</b>"
    if both is not None:
        text += f", 95 % interval {number(both[0])} to {number(both[1])}"
    text += f" ({_counts(row)}, at {row['births']} births{p})"
    return (
        f'<div class="difference"><p>{a} minus {b}: {text}<br>'
        f'<span class="verdict">{escape(_verdict(row, both))}</span></p>'
        f"{_bar(row['difference'], both, reach)}</div>"
    )


def _counts(row: Row) -> str:
    return f"{row['runs_a']} and {counted(row['runs_b'], 'run')}"


def _verdict(row: Row, both: tuple[float, float] | None) -> str:
    """Return what interval and test say together."""
    if both is None:
        if min(row["runs_a"], row["runs_b"]) >= _SURE:
            return "no interval: all runs of one are equal, and they are fewer than ten"
        return "no interval: it needs two finished runs of each (--repeats)"
    if row["apart"]:
        return "in an arena and off-line: this does not show which is fitter"
    if both[0] <= 0 <= both[1]:
        why = "the interval includes 0: these runs do not tell which is fitter"
        return f"{why}{_needed(row)}"
    return _tested(row, label(row["a"] if both[0] > 0 else row["b"]))


def _needed(row: Row) -> str:
    if row["runs_needed"] is None:
        return ""
    many = f"{row['runs_needed']} runs of each"
    return f"; if the effect is as seen, {many} show it four times in five"


def _tested(row: Row, higher: str) -> str:
    if row["p"] < _LEVEL:
        return f"{higher} is fitter: the interval excludes 0, and p < {_LEVEL:g}"
    verdict = f"undecided: the interval excludes 0, but p is not below {_LEVEL:g}"
    least = 2.0 / comb(row["runs_a"] + row["runs_b"], row["runs_a"])
    if least < _LEVEL:
        return f"{verdict}{_needed(row)}"
    below = f"with {_counts(row)} it cannot be below {number(least)}"
    return f"{verdict}; {below}{_needed(row)}"


def _bar(value: float, both: tuple[float, float] | None, reach: float) -> str:
    def at(number: float) -> float:
        return 200 + 190 * number / reach

    interval = ""
    if both is not None:
        interval = (
            f'<path class="interval" d="M{at(both[0]):.1f} 12H{at(both[1]):.1f}"/>'
        )
    ticks = "".join(
        f'<path class="zero" d="M{at(place):.1f} {top}V24"/>'
        f'<text x="{at(place):.1f}" y="38" text-anchor="{anchor}">'
        f"{number(float(place))}</text>"
        for place, top, anchor in ((-reach, 19, "start"), (0, 0, "middle"),
                                   (reach, 19, "end"))
    )  # fmt: skip
    return (
        '<svg class="bar" viewBox="0 0 400 42" role="img" aria-label="interval">'
        f'<path class="zero" d="M10 24H390"/>{ticks}{interval}'
        f'<circle cx="{at(value):.1f}" cy="12" r="5"/></svg>'
    )


def all_differences(tables: Tables) -> str:
    """Return a folded table of all measures for each pair of experiments.

    Measures without a p are equal in all runs of the pair: they are only counted. The
    meanings of the others are in a folded list below.
    """
    pairs: dict[tuple[str, str], list[Row]] = {}
    for row in tables["comparison"].to_pylist():
        pairs.setdefault((row["a"], row["b"]), []).append(row)
    columns = ("mean_a", "mean_b", "difference", "difference_low", "difference_high",
               "effect", "p", "q", "runs_needed")  # fmt: skip
    folds, shown = [], set()
    for (a, b), every in pairs.items():
        mine = [row for row in every if row["p"] is not None]
        shown |= {row["measure"] for row in mine}
        heads = ("measure", label(a), label(b), "difference", "low", "high", "effect",
                 "p", "q", "runs needed")  # fmt: skip
        rows = []
        for row in mine:
            known = row if interval(row) else {**row, "difference_low": None,
                                                "difference_high": None}  # fmt: skip
            name = row["measure"]
            first = f'<td title="{escape(meaning(name))}">{escape(_words(name))}</td>'
            rows.append([first, *(cell(known[column]) for column in columns)])
        title = (
            f"{label(a)} ({counted(every[0]['runs_a'], 'run')}) and {label(b)} "
            f"({counted(every[0]['runs_b'], 'run')}) at {every[0]['births']} births"
        )
        folds.append(folded(title, table(heads, rows) + _equal(every)))
    if not folds:
        return ""
    note = (
        "Means over finished runs; low and high are the ends of the difference's 95 % "
        "interval (Welch's t). The effect is Cliff's delta: how much more often a run "
        "of the first experiment is above one of the second than below. p is that of "
        "the exact rank-sum test (Wilcoxon, Mann and Whitney), which assumes no "
        "distribution; q is p, corrected for all tests of this section. Runs needed: "
        "of each experiment, for p < 0.05 with a probability of 80 % if the effect is "
        "as seen. "
        "Measures that are equal in all runs of both experiments are not tested."
    )
    folds.append(folded("What the measures mean", _meanings(shown)))
    apart = _apart(tables)
    return f'{apart}<p class="note">{escape(note)}</p>{"".join(folds)}'


def _equal(rows: Sequence[Row]) -> str:
    names = [_words(row["measure"]) for row in rows if row["p"] is None]
    if not names:
        return ""
    count = f"{counted(len(names), 'measure')} {'is' if len(names) == 1 else 'are'}"
    text = f"{count} equal in all runs: {', '.join(names)}."
    return f'<p class="note">{escape(text)}</p>'


def _meanings(measures: Collection[str]) -> str:
    named = [name for name in OUTCOME if name in measures]
    named += sorted(set(measures) - set(named))
    rows = [[cell(_words(name)), cell(meaning(name))] for name in named]
    return table(("measure", "meaning"), rows)


def _words(measure: str) -> str:
    return measure.replace("_", " ")
