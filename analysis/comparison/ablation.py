"""Table of fitness without sensors and motors, and what it comes to.

Each row is one robot without some of its sensors or motors, or with another brain.
"""

from collections.abc import Iterable, Sequence
from statistics import median

import pyarrow as pa

from analysis.comparison.robustness import RESULT, ROBOT, Columns, Row, line_of, percent
from schema.errors import rounded

HELD, MEAN, DEAD = "input at 0", "input at its mean", "motor dead"
RANDOM = "random brain"
ONE, KIND, ALL = "one", "kind", "all"
_SHOWN = 3
"""Motors that the line about a run names."""

COLUMNS: Columns = {
    **ROBOT,
    "is_last": (
        pa.bool_(),
        "whether it is among the fittest of the last populations, as many as asked for",
    ),
    "group": (pa.string(), f"'{HELD}', '{MEAN}', '{DEAD}' or '{RANDOM}'"),
    "scope": (
        pa.string(),
        f"'{ONE}' input, motor or random brain, all of a '{KIND}', or '{ALL}'",
    ),
    "kind": (
        pa.string(),
        (
            "of the sensors: imu, touch, light or a plug-in's class; part type of the "
            f"motors; empty for '{ALL}' and random brains"
        ),
    ),
    "part": (pa.int32(), f"index of the part in births.body; null unless '{ONE}'"),
    "channel": (
        pa.int32(),
        (
            "number of the input or motor of the brain, or of the random brain; null "
            f"unless '{ONE}'"
        ),
    ),
    "change": (pa.string(), "the change in words"),
    **RESULT,
}


def shares(rows: Iterable[Row], group: str, scope: str, kind: str = "") -> list[float]:
    """Return the known shares of some rows; every kind if it is empty."""
    return [
        row["share"]
        for row in rows
        if row["share"] is not None
        and (row["group"], row["scope"]) == (group, scope)
        and kind in ("", row["kind"])
    ]


def summary(table: pa.Table) -> str:
    """Return one line that says what carries the fitness of a run's robots."""
    return line_of(table, _of_best, _of_last)


def _of_best(name: str, rows: Sequence[Row]) -> str:
    kept = [
        f"{percent(share)} without {row['kind']}"
        for row in rows
        if row["group"] == HELD and row["scope"] == KIND
        and (share := row["share"]) is not None
    ]  # fmt: skip
    for text, known in (
        ("without sensors", shares(rows, HELD, ALL)),
        ("with sensors at their mean", shares(rows, MEAN, ALL)),
        ("with a random brain", shares(rows, RANDOM, ONE)),
    ):
        kept += [f"{percent(median(known))} {text}"] if known else []
    single = (row for row in rows if (row["group"], row["scope"]) == (DEAD, ONE))
    # Without some motors a robot gains: these carry nothing.
    dead = [row for row in single if row["share"] is not None and row["share"] <= 1.0]
    first = sorted(dead, key=lambda row: (row["share"], row["channel"]))[:_SHOWN]
    carried = [
        f"the {row['change']} carries {percent(1 - row['share'])}" for row in first
    ]
    line = f"{name} ({_fitness(rows[0])})"
    line += f", keeps {', '.join(kept)}" if kept else ""
    return "; ".join([line, *([", ".join(carried)] if carried else [])])


def _fitness(row: Row) -> str:
    """Return the fitness alone, and the recorded one if it is another, of an arena."""
    alone, recorded = rounded(row["undisturbed"]), rounded(row["recorded"])
    if alone == recorded:
        return f"fitness {alone}"
    return f"fitness {alone} alone, {recorded} recorded"


def _of_last(robots: Sequence[Sequence[Row]]) -> str:
    """Return what the medians over robots of the last population are."""
    texts = []
    one = len(robots) == 1
    for text, group, scope, least in (
        ("without sensors", HELD, ALL, False),
        (f"without {'its' if one else 'their'} most important motor", DEAD, ONE, True),
        ("with a random brain", RANDOM, ONE, False),
    ):
        own = [shares(rows, group, scope) for rows in robots]
        known = [min(each) if least else median(each) for each in own if each]
        texts += [f"{percent(median(known))} {text}"] if known else []
    if not texts:
        return ""
    keep = "keeps" if one else "keep"
    text = f"{len(robots)} of the last population {keep} {', '.join(texts)}"
    return text if one else f"{text} in the median"
