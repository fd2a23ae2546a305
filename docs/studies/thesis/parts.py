"""Generated parts of docs/results.md and docs/findings.md: tables of the campaign."""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc

from analysis.comparison.claims import TOUCHES
from analysis.comparison.findings import LARGE, SURE
from analysis.comparison.statistics import ALPHA, alike_power
from analysis.figures.style import in_order, label, pair_name
from docs.studies.pages import Parts, markdown
from docs.studies.thesis.data import BRIDGES, PARTS
from docs.studies.thesis.later import bridges, parts_of, populations, topics

Tables = Mapping[str, pa.Table]
Row = dict[str, Any]

VERDICTS = ("reproduced", "not reproduced", "undecided", "does not apply")
_ROWS = (
    ("fitness", "fitness [m/s]", 3, "0 to 0.5"),
    ("gain", "gain over founders [m/s]", 3, ""),
    ("size_mean", "living robots, mean over births", 1, ""),
    ("parts", "parts", 1, "0 to 30"),
    ("parts_change", "parts more than random robots have", 1, ""),
    ("joints", "joints", 1, "0 to 20"),
    ("active_joints", "active joints", 1, ""),
    ("passive_joints", "passive joints", 1, ""),
    ("joints_per_part", "joints per part", 2, "0 to 1"),
    ("extremities", "extremities", 1, "0 to 15"),
    ("extremities_per_part", "extremities per part", 2, "0 to 0.8"),
    ("touch_sensors", "touch sensors", 2, "0 to 4"),
    ("hidden", "hidden neurons", 1, ""),
    ("rank", "rank", 0, ""),
    ("ancestors_per_robot", "ancestors per robot", 1, "10 to 50"),
    ("diversity", "tree edit distance", 1, "0 to 25"),
    ("retention", "retention after 120 births, mean over births", 2, "0 to 0.75"),
    (
        "touching",
        "contact time per lifetime (simultaneous contacts count separately)",
        3,
        "",
    ),
    ("touched", "share of robots that ever touched another", 2, ""),
)
"""Measures of the table of ends: column, text, decimals, axis in the thesis."""
_CONTROLS = (
    ("parts_fitness", "rank correlation of fitness with size", "6.9"),
    ("extremities_fitness", "fitness with extremities", "6.14"),
    ("extremities_per_part_fitness", "fitness with extremities per part", "6.14"),
    ("retention_fitness", "fitness with retention, over births", "6.7"),
    ("early_diversity", "tree edit distance, mean of the first tenth", "6.5"),
    ("early_drop", "share of its loss in the first tenth", "6.5"),
    ("family_distance", "distance in the best robot's family / of founders",
     "6.18-6.20"),
    ("family_founders", "founders of that family's parts", "6.18-6.20"),
)  # fmt: skip
"""Measures that are compared with the baselines': column, text, figures."""
_CROWDED = 30
"""Most robots that live in an arena of the thesis."""
_PLANNED = {name: part.repeats for part in PARTS for name in part.names}
_SPEEDS = (5, 15, 30, 50)
"""Numbers of robots whose speed is printed."""


def pages_of(tables: Tables) -> dict[str, Parts]:
    """Return the lines of each generated part by page and name.

    Args:
        tables: as ``docs.studies.thesis.results.tables_of`` returns them.
    """
    return {
        "results.md": {
            "runs": _runs(tables),
            "ends": _ends(tables),
            "arenas": _arenas(tables),
            "verdicts": _verdicts(tables),
            "topics": _topics(tables),
            "differences": _differences(tables),
            "controls": _controls(tables),
            "speed": _speed(tables),
            **parts_of(tables),
        },
        "starts.md": {"bridges": bridges(), "populations": populations()},
        "findings.md": {"power": _power(tables), "all": _all(tables)},
    }


def _runs(tables: Tables) -> list[str]:
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
    return markdown(["experiment", "repeats", "births", "commit", "platform"], rows)


def _last(tables: Tables) -> dict[str, pa.Table]:
    """Return the outcomes at the end of each experiment of the thesis."""
    outcomes = tables["outcomes"].filter(~pc.field("experiment").isin(BRIDGES))
    found = {}
    for name in in_order(outcomes["experiment"].to_pylist()):
        mine = outcomes.filter(pc.field("experiment") == name)
        found[name] = mine.filter(pc.field("births") == pc.max(mine["births"]).as_py())
    return found


def _ends(tables: Tables) -> list[str]:
    """Return means over runs at the end, with least and greatest run."""
    last = _last(tables)
    heads = [
        "",
        *(
            f"{label(name)}, {rows.num_rows} x {rows['births'][0]} births"
            for name, rows in last.items()
        ),
        "axis in the thesis",
    ]
    rows = [
        [text, *(_of_runs(runs, measure, decimals) for runs in last.values()), axis]
        for measure, text, decimals, axis in _ROWS
    ]
    return markdown(heads, rows)


def _arenas(tables: Tables) -> list[str]:
    """Return one row per arena of scenario 3: how many lived there, and its end."""
    arenas, populations = _last(tables).get("scenario3"), tables["populations"]
    rows = []
    for arena in [] if arenas is None else arenas.to_pylist():
        mine = populations.filter(pc.field("folder") == arena["folder"])
        sizes, mature = (np.asarray(mine[name]) for name in ("size", "judged"))
        rows.append(
            [
                str(arena["run"]),
                f"{arena['size_mean']:.1f} ({sizes.max()})",
                f"{mature.mean():.1f} ({mature.max()})",
                str(int((sizes >= _CROWDED).sum())),
                f"{arena['fitness']:.3f}",
                f"{arena['rank']:.0f}",
                f"{arena['retention']:.2f}",
            ]
        )
    heads = ["repeat", "living robots (most)", "mature robots (most)",
             f"populations of {_CROWDED}", "fitness [m/s]", "rank",
             "retention"]  # fmt: skip
    return markdown(heads, rows)


def _controls(tables: Tables) -> list[str]:
    """Return measures of findings beside those of the baselines, means over runs."""
    last = _last(tables)
    names = [name for name in last if name != TOUCHES]
    rows = [
        [figure, text, *(_of_runs(last[name], measure, 2) for name in names)]
        for measure, text, figure in _CONTROLS
    ]
    return markdown(["figure", "measure", *map(label, names)], rows)


def _of_runs(outcomes: pa.Table, measure: str, decimals: int) -> str:
    return _spread(outcomes[measure].drop_null().to_numpy(), decimals)


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


def _verdicts(tables: Tables) -> list[str]:
    """Return how many findings have which verdict."""
    rows = tables["findings"].to_pylist()
    sure = [row for row in rows if not row["near_automatic"]]
    untested = [row for row in rows if row["runs_a"] is None]
    off_line = [row for row in rows if "scenario3" not in (row["a"], row["b"])]
    repeats = f"{_last(tables)['scenario3'].num_rows} of {_PLANNED['scenario3']}"
    lines = [
        f"Of {len(rows)} findings: **{_counts(rows)}**.",
        f"- {topics(rows)}",
        f"- Without the {len(rows) - len(sure)} marked †: {_counts(sure)}.",
        f"- Without scenario 3 ({repeats} repeats): {_counts(off_line)}.",
    ]
    if untested:
        reasons = sorted({row["why"] for row in untested})
        lines.append(
            f"- {len(untested)} of the undecided ones have no numbers yet "
            f"({'; '.join(reasons)})."
        )
    return lines


def _power(tables: Tables) -> list[str]:
    """Return the power of the equivalence test, as it stands and as planned.

    The corrected p of a test is below 5 % if p is below this share of 5 %: the number
    of tests that show something to be alike, of all of them.
    """
    sizes = {name: rows.num_rows for name, rows in _last(tables).items()}
    q = tables["findings"]["q_alike"].drop_null().to_numpy()
    corrected = ALPHA * max(1, int((q < SURE).sum())) / max(1, len(q))
    rows = []
    for a, b in (
        ("scenario1", "scenario2"),
        ("scenario1", "scenario3"),
        ("scenario1", "no-selection"),
        ("scenario3", "no-selection"),
    ):
        now, planned = ((of.get(a, 0), of.get(b, 0)) for of in (sizes, _PLANNED))
        for runs, text in {planned: ", planned", now: ""}.items():
            powers = [alike_power(*runs, LARGE, level) for level in (ALPHA, corrected)]
            rows.append(
                [
                    f"{label(a)}, {label(b)}",
                    f"{runs[0]}, {runs[1]}{text}",
                    *(f"{power:.2f}" for power in powers),
                ]
            )
    heads = ["compared", "repeats", "power", f"power at p < {corrected:.3f}"]
    return markdown(heads, rows)


def _grouped(tables: Tables, chosen: Callable[[Row], bool]) -> dict[Any, list[Row]]:
    """Return the findings that are chosen by figure, topic and direction."""
    groups: dict[Any, list[Row]] = {}
    for row in tables["findings"].to_pylist():
        if chosen(row):
            key = (row["figure"], row["topic"], row["expected"])
            groups.setdefault(key, []).append(row)
    return groups


def _topics(tables: Tables) -> list[str]:
    """Return one row per finding without names: the pairs by verdict."""
    rows = []
    found = set(tables["findings"]["verdict"].to_pylist())
    verdicts = [name for name in VERDICTS if name in found]
    for (figure, topic, _), group in _grouped(tables, lambda _: True).items():
        cells = [
            ", ".join(pair_name(row) for row in group if row["verdict"] == verdict)
            for verdict in verdicts
        ]
        rows.append([figure, topic, *cells])
    return markdown(["figure", "finding", *verdicts], rows)


def _differences(tables: Tables) -> list[str]:
    """Return the findings that are not reproduced, with their numbers."""
    rows = [
        [row["figure"], row["claim"], *_numbers(row)]
        for row in tables["findings"].to_pylist()
        if row["verdict"] == "not reproduced"
    ]
    if not rows:
        return ["None of the findings is *not reproduced*."]
    return markdown(["figure", "finding", *_NUMBERS], rows)


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


def _all(tables: Tables) -> list[str]:
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
    return markdown(heads, rows)


def _speed(tables: Tables) -> list[str]:
    """Return real-time factors of arenas."""
    rows = []
    for kind, text in (("arena", "random robots"), ("spider", "spiders")):
        mine = tables["benchmark"].filter(pc.field("benchmark") == kind)
        if not mine.num_rows:
            rows.append([text, *["not measured yet"] * len(_SPEEDS), ""])
            continue
        sizes = np.asarray(mine["population"])
        factors = np.asarray(mine["factor"])
        means = [_spread(factors[sizes == size], 1) for size in _SPEEDS]
        count = int((sizes == _SPEEDS[0]).sum())
        rows.append([text, *means, str(count)])
    heads = ["arena of", *(f"{size} robots" for size in _SPEEDS), "repetitions"]
    return markdown(heads, rows)
