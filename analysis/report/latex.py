"""The comparison of experiments as LaTeX."""

import re
from itertools import groupby
from operator import itemgetter

import pyarrow as pa

from analysis.figures.forms import Row
from analysis.report.differences import interval

_SPECIAL = re.compile(r"([\\{}$&#^_%~])")
_ESCAPED = {"\\": r"\textbackslash{}", "^": r"\^{}", "~": r"\~{}"}
_HEAD = (
    "% Means over finished runs; 95 % interval of the difference (Welch's t); p of the",
    "% exact rank-sum test; q is p corrected for all tests (Benjamini-Hochberg).",
)


def comparison_latex(comparison: pa.Table) -> str:
    """Return a ``tabular`` for each pair of experiments, without preamble.

    As in the report, measures that are equal in all runs of a pair have no row.

    Args:
        comparison: table of ``analysis.comparison.comparison``.
    """
    pairs = groupby(comparison.to_pylist(), itemgetter("a", "b"))
    tabulars = [_tabular(list(rows)) for _, rows in pairs]
    return "\n".join([*_HEAD, *tabulars])


def _tabular(rows: list[Row]) -> str:
    first = rows[0]
    a, b = (_text(f"{first[name]} ({first[f'runs_{name}']})") for name in "ab")
    lines = [
        f"% at {first['births']} births",
        r"\begin{tabular}{lrrrrrr}",
        r"\hline",
        rf"measure & {a} & {b} & difference & 95\,\% interval & $p$ & $q$ \\",
        r"\hline",
    ]
    for row in rows:
        if row["p"] is not None:
            ends = interval(row)
            means = (_number(row[name]) for name in ("mean_a", "mean_b", "difference"))
            between = f"[{_number(ends[0])}, {_number(ends[1])}]" if ends else "--"
            cells = [_text(row["measure"].replace("_", " ")), *means, between]
            cells += [_number(row["p"]), _number(row["q"])]
            lines.append(" & ".join(cells) + r" \\")
    return "\n".join([*lines, r"\hline", r"\end{tabular}", ""])


def _text(words: str) -> str:
    """Return words with all characters that are special in LaTeX escaped."""
    return _SPECIAL.sub(lambda each: _ESCAPED.get(each[1], f"\\{each[1]}"), words)


def _number(value: float) -> str:
    """Return a number with 3 significant digits, in mathematical mode."""
    mantissa, _, exponent = f"{value:.3g}".partition("e")
    power = rf" \cdot 10^{{{int(exponent)}}}" if exponent else ""
    return f"${mantissa}{power}$"
