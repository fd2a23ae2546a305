"""Generated parts of docs/results.md: Markdown tables of the campaign's numbers."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from analysis.comparison.equivalence import alike_power
from analysis.comparison.verdicts import LARGE
from analysis.figures.style import in_order, label
from docs.campaign_data import PARTS

Tables = Mapping[str, pa.Table]
Row = dict[str, Any]

VERDICTS = ("reproduced", "not reproduced", "undecided", "does not apply")
_ROWS = (
    ("fitness", "fitness [m/s]", 3),
    ("gain", "gain over founders [m/s]", 3),
    ("size_mean", "living robots, mean over births", 1),
    ("parts", "parts", 1),
    ("active_joints", "active joints", 1),
    ("passive_joints", "passive joints", 1),
    ("joints_per_part", "joints per part", 2),
    ("extremities", "extremities", 1),
    ("touch_sensors", "touch sensors", 2),
    ("hidden", "hidden neurons", 1),
    ("rank", "rank", 0),
    ("ancestors_per_robot", "ancestors per robot", 1),
    ("diversity", "tree edit distance", 1),
    ("retention", "retention after 120 births", 2),
    (
        "touching",
        "contact time per lifetime (simultaneous contacts count separately)",
        3,
    ),
)
"""Measures of the table of ends: column, text, decimals."""
_SPEEDS = (5, 15, 30, 50)
"""Numbers of robots whose speed is printed."""


def parts_of(tables: Tables) -> dict[str, str]:
    """Return the Markdown of each generated part by its name.

    Args:
        tables: as ``docs.results.tables_of`` returns them.
    """
    return {
        "runs": _runs(tables),
        "ends": _ends(tables),
        "verdicts": _verdicts(tables),
        "power": _power(tables),
        "topics": _topics(tables),
        "differences": _differences(tables),
        "all": _all(tables),
        "speed": _speed(tables),
    }


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    lines = [heads, ["---"] * len(heads), *rows]
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def _runs(tables: Tables) -> str:
    """Return repeats, births, platform and commit of each experiment."""
    details = tables["runs"].to_pylist()
    rows = []
    for part in PARTS:
        for name in part.names:
            mine = [row for row in details if row["experiment"] == name]
            commits = {str(row["commit"])[:7] for row in mine}
            platforms = {tag for row in mine for tag in row["platform"].split()}
            rows.append(
                [
                    label(name),
                    f"{len(mine)} of {part.repeats}",
                    str(part.births),
                    ", ".join(sorted(commits)) or "-",
                    ", ".join(f"`{tag}`" for tag in sorted(platforms)) or "-",
                ]
            )
    return _table(["experiment", "repeats", "births", "commit", "platform"], rows)


def _last(tables: Tables) -> dict[str, pa.Table]:
    """Return the outcomes of each experiment at the end."""
    outcomes = tables["outcomes"]
    found = {}
    for name in in_order(outcomes["experiment"].to_pylist()):
        mine = outcomes.filter(pc.field("experiment") == name)
        found[name] = mine.filter(pc.field("births") == pc.max(mine["births"]).as_py())
    return found


def _ends(tables: Tables) -> str:
    """Return means over runs at the end, with least and greatest run."""
    last = _last(tables)
    heads = [""] + [
        f"{label(name)}, {rows.num_rows} x {rows['births'][0]} births"
        for name, rows in last.items()
    ]
    rows = []
    for measure, text, decimals in _ROWS:
        cells = []
        for outcomes in last.values():
            values = outcomes[measure].drop_null().to_numpy()
            cells.append(_spread(values, decimals))
        rows.append([text, *cells])
    return _table(heads, rows)


def _spread(values: Any, decimals: int) -> str:  # noqa: ANN401 - array of numbers
    if not len(values):
        return "-"
    mean, least, greatest = (
        f"{_plain(value, decimals)}"
        for value in (values.mean(), min(values), max(values))
    )
    return mean if len(values) == 1 else f"{mean} ({least}, {greatest})"


def _plain(value: float, decimals: int) -> str:
    """Return a number with so many decimals, never as -0."""
    return f"{round(value, decimals) + 0.0:.{decimals}f}"


def _counts(rows: Sequence[Row]) -> str:
    counts = {name: sum(row["verdict"] == name for row in rows) for name in VERDICTS}
    return ", ".join(
        f"{count} {'do not apply' if name == VERDICTS[-1] else name}"
        for name, count in counts.items()
        if count
    )


def _verdicts(tables: Tables) -> str:
    """Return how many findings have which verdict."""
    rows = tables["findings"].to_pylist()
    sure = [row for row in rows if not row["near_automatic"]]
    untested = [row for row in rows if row["runs_a"] is None]
    marked = f"Without the {len(rows) - len(sure)} that follow almost by construction"
    lines = [
        f"Of {len(rows)} findings: **{_counts(rows)}**.",
        f"{marked}, marked †: {_counts(sure)}.",
    ]
    if untested:
        reasons = sorted({row["why"] for row in untested})
        lines.append(
            f"{len(untested)} of the undecided ones have no numbers yet "
            f"({'; '.join(reasons)})."
        )
    return "\n".join(lines)


def _power(tables: Tables) -> str:
    """Return the power of the equivalence test, as it stands and as planned."""
    last = _last(tables)
    sizes = {name: rows.num_rows for name, rows in last.items()}
    planned = {name: part.repeats for part in PARTS for name in part.names}
    rows = []
    for a, b in (
        ("scenario1", "scenario2"),
        ("scenario1", "scenario3"),
        ("scenario1", "no-selection"),
        ("scenario3", "no-selection"),
    ):
        now = sizes.get(a, 0), sizes.get(b, 0)
        power = f"{_powers(*now):.2f}" if min(now) > 1 else "-"
        then = planned[a], planned[b]
        rows.append(
            [
                f"{label(a)}, {label(b)}",
                f"{now[0]}, {now[1]}",
                power,
                f"{then[0]}, {then[1]}",
                f"{_powers(*then):.2f}",
            ]
        )
    heads = ["compared", "repeats", "power", "planned repeats", "power then"]
    return _table(heads, rows)


def _powers(first: int, second: int) -> float:
    return alike_power(first, second, LARGE)


def _grouped(tables: Tables, chosen: Callable[[Row], bool]) -> dict[Any, list[Row]]:
    """Return the findings that are chosen by figure, topic and direction."""
    groups: dict[Any, list[Row]] = {}
    for row in tables["findings"].to_pylist():
        if chosen(row):
            key = (row["figure"], row["topic"], row["expected"])
            groups.setdefault(key, []).append(row)
    return groups


def _name(row: Row) -> str:
    short = {"no-reproduction": "random", "no-selection": "drift"}
    names = [str(row[key]) for key in "ab" if row[key]]
    return "/".join(short.get(name, name.removeprefix("scenario")) for name in names)


def _topics(tables: Tables) -> str:
    """Return one row per finding without names: the pairs by verdict."""
    rows = []
    for (figure, topic, _), group in _grouped(tables, lambda _: True).items():
        cells = [
            ", ".join(
                f"{_name(row)}{'†' if row['near_automatic'] else ''}"
                for row in group
                if row["verdict"] == verdict
            )
            for verdict in VERDICTS
        ]
        rows.append([figure, topic, *cells])
    return _table(["figure", "finding", *VERDICTS], rows)


def _differences(tables: Tables) -> str:
    """Return the findings that are not reproduced, with their numbers."""
    rows = [
        [row["figure"], row["claim"], *_numbers(row)]
        for row in tables["findings"].to_pylist()
        if row["verdict"] == "not reproduced"
    ]
    if not rows:
        return "None of the findings is *not reproduced*."
    return _table(["figure", "finding", *_NUMBERS], rows)


_NUMBERS = ("means", "difference (95 %)", "effect (95 %)", "q", "q alike")


def _numbers(row: Row) -> list[str]:
    if row["mean_a"] is None:
        return [""] * len(_NUMBERS)
    return [
        f"{_short(row['mean_a'])}; {_short(row['mean_b'])}",
        _interval(row, "difference"),
        _interval(row, "effect"),
        *("" if row[q] is None else f"{row[q]:.2g}" for q in ("q", "q_alike")),
    ]


def _interval(row: Row, name: str) -> str:
    ends = row[f"{name}_low"], row[f"{name}_high"]
    if None in ends:
        return _short(row[name])
    return f"{_short(row[name])} ({_short(ends[0])}, {_short(ends[1])})"


_WHOLE = 1000
"""Size from which on a number has no decimals."""


def _short(value: float) -> str:
    """Return a number with three digits, without an exponent."""
    rounded = float(f"{value:.3g}")
    if abs(rounded) >= _WHOLE:
        return f"{rounded:.0f}"
    return _plain(rounded, 4).rstrip("0").rstrip(".")


def _all(tables: Tables) -> str:
    """Return one row per finding, with its numbers and the rule of the verdict."""
    rows = []
    for row in tables["findings"].to_pylist():
        runs = [row[key] for key in ("runs_a", "runs_b") if row[key] is not None]
        mark = " †" if row["near_automatic"] else ""
        rows.append(
            [
                row["figure"],
                f"{row['claim']}{mark}",
                " / ".join(map(str, runs)),
                *_numbers(row),
                "" if row["power"] is None else f"{row['power']:.2f}",
                row["verdict"],
                row["why"].replace("|", "\\|"),
            ]
        )
    heads = ["figure", "finding", "runs", *_NUMBERS, "power", "verdict", "rule"]
    return _table(heads, rows)


def _speed(tables: Tables) -> str:
    """Return real-time factors of arenas."""
    rows = []
    for kind, text in (("arena", "random robots"), ("spider", "spiders")):
        mine = tables["benchmark"].filter(pc.field("benchmark") == kind)
        if not mine.num_rows:
            rows.append([text, *["not measured yet"] * len(_SPEEDS), ""])
            continue
        sizes = np.asarray(mine["population"])
        factors = np.asarray(mine["factor"])
        means = [f"{factors[sizes == size].mean():.3g}" for size in _SPEEDS]
        count = int((sizes == _SPEEDS[0]).sum())
        rows.append([text, *means, str(count)])
    heads = ["arena of", *(f"{size} robots" for size in _SPEEDS), "repetitions"]
    return _table(heads, rows)
