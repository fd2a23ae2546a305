"""Verdicts: whether a finding of the thesis is reproduced, and the rule."""

from collections.abc import Mapping
from typing import Any

SURE = 0.05
"""Greatest corrected p of a verdict."""
NEGLIGIBLE, LARGE = 0.147, 0.474
"""Bounds of Cliff's delta: the largest negligible effect, and the least large one.

"Alike" means no large effect. Source: Romano et al., 2006, after Cohen's d.
"""
RARE = 0.1
"""Share of runs below which something is said not to occur."""

Verdict = tuple[str, str]
Row = Mapping[str, Any]


def verdict(expected: str, row: Row) -> Verdict:
    """Return whether a finding is reproduced, and the rule of the verdict.

    Args:
        expected: as ``Claim.expected``.
        row: ``effect``, ``q``, ``margin``; the ends of the interval of the effect, or
            of the difference where an experiment is compared with a number (unknown
            ends are as far apart as possible); with "=", ``q_alike``; with "some",
            ``runs_a`` and ``effect``, the share of runs.
    """
    if expected == "some":
        return _some(row)
    is_of_two = row.get("runs_b") is not None
    name, of = ("effect", "") if is_of_two else ("difference", " of the difference")
    low, high = _end(row, f"{name}_low", -1), _end(row, f"{name}_high", 1)
    margin = row["margin"]
    if expected == "=":
        return _alike(row, (low, high), row[name])
    if expected == "!=":
        return _different(row, max(abs(low), abs(high)))
    sign = 1 if expected == ">" else -1
    if max(sign * low, sign * high) < margin:
        why = (
            f"the 95 % interval{of} (uncorrected) ends below {margin:g}: the effect in "
            "the expected direction is at most negligible"
        )
        return "not reproduced", why
    return _directed(row, sign)


def _directed(row: Row, sign: int) -> Verdict:
    if row["q"] >= SURE:
        return "undecided", f"q >= {SURE}: no significant difference"
    if row["effect"] * sign > 0:
        return "reproduced", f"q < {SURE}, and the effect is as expected"
    return "not reproduced", f"q < {SURE}, and the effect has the opposite sign"


def _end(row: Row, name: str, sign: int) -> float:
    value = row.get(name)
    return sign * float("inf") if value is None else float(value)


def _alike(row: Row, ends: tuple[float, float], found: float) -> Verdict:
    margin = row["margin"]
    if row["q_alike"] < SURE:
        return "reproduced", f"two one-sided tests: within +-{margin:g}, q < {SURE}"
    low, high = ends
    if (low > 0 or high < 0) and abs(found) >= margin and row["q"] < SURE:
        return "not reproduced", f"q < {SURE}, and the estimate is beyond +-{margin:g}"
    return "undecided", f"shown neither to be within +-{margin:g} nor to be beyond"


def _different(row: Row, most: float) -> Verdict:
    if row["q"] < SURE:
        return "reproduced", f"q < {SURE}"
    if most < row["margin"]:
        return "not reproduced", f"the interval is within +-{row['margin']:g}"
    return "undecided", f"q >= {SURE}: no significant difference"


def _some(row: Row) -> Verdict:
    if row["effect"] > 0:
        return "reproduced", "it occurs"
    most = 1 - SURE ** (1 / row["runs_a"])
    if most < RARE:
        return "not reproduced", f"in no run; with 95 % certainty in less than {RARE:g}"
    return "undecided", f"in no run, but possibly in {most:.2f} of them"
