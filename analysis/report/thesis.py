"""Section of the thesis's findings."""

from html import escape

from analysis.figures.forms import Row, Tables
from analysis.report.html import cell, folded, table

_HEADS = ("figure", "finding", "expected", "runs", "mean a", "mean b", "effect",
          "low", "high", "q", "verdict", "why")  # fmt: skip
_NOTE = (
    "The unit is the run. Means are those of the experiments. The effect is Cliff's "
    "delta of a over b with its 95 % interval, or the rank-biserial correlation where "
    "one experiment is compared with a number; it compares what the finding says: "
    "values, a share of those of b, or distances of runs from their median. q is the "
    "p value, corrected for all tests of the table."
)


def findings(tables: Tables) -> str:
    """Return a table of the findings' tests; folded if none could be tested."""
    rows = tables["findings"].to_pylist()
    if not rows:
        return ""
    verdicts = [str(row["verdict"]) for row in rows]
    counts = [
        f"{verdicts.count(verdict)} {verdict}"
        for verdict in ("reproduced", "not reproduced", "undecided")
    ]
    if apart := verdicts.count("does not apply"):
        counts.append(f"{apart} {'does' if apart == 1 else 'do'} not apply")
    is_tested = any(row["runs_a"] is not None for row in rows)
    about = (
        f"{', '.join(counts)}."
        if is_tested
        else f"None of the {len(rows)} findings can be tested: they are about "
        "experiments of the thesis (scenario1 and others), two finished runs of each."
    )
    note = f'<p class="note">{escape(_NOTE)}</p>'
    content = note + table(_HEADS, [_line(row) for row in rows])
    title = f"All {len(rows)} findings"
    return f"<p><b>{escape(about)}</b></p>" + folded(title, content, is_open=is_tested)


def _line(row: Row) -> list[str]:
    verdict = str(row["verdict"])
    kind = verdict.split(maxsplit=1)[0]
    badge = f'<span class="v {kind}">{escape(verdict)}</span>'
    counts = (row["runs_a"], row["runs_b"])
    counted = " / ".join(str(count) for count in counts if count is not None)
    cells = [row[name] for name in ("figure", "claim", "expected")]
    numbers = ("mean_a", "mean_b", "effect", "effect_low", "effect_high", "q")
    cells += [counted or "–", *(row[name] for name in numbers)]
    return [*map(cell, cells), f"<td>{badge}</td>", cell(row["why"])]
