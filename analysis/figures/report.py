"""The report: one self-contained HTML file, without links to the network."""

import base64
from collections.abc import Mapping, Sequence
from datetime import datetime
from html import escape

import pyarrow as pa

from analysis.figures.catalogue import DrawnFigure
from analysis.figures.style import in_order, label
from analysis.measures.outputs import OUTPUTS

_STYLE = """
:root { --ink: #24292f; --faint: #6b7280; --line: #e5e7eb; --pale: #f6f7f9; }
* { box-sizing: border-box; }
body { margin: 0; color: var(--ink); background: #fff;
  font: 16px/1.55 system-ui, -apple-system, "Segoe UI", Roboto, sans-serif; }
main { max-width: 60rem; margin: 0 auto; padding: 2.5rem 1.5rem 5rem; }
h1 { font-size: 2rem; line-height: 1.2; margin: 0 0 .3rem; }
h2 { font-size: 1.3rem; margin: 3rem 0 .8rem; padding-bottom: .3rem;
  border-bottom: 2px solid var(--line); }
p.lead, figcaption, .note { color: var(--faint); }
figure { margin: 2.2rem 0 2.8rem; }
figure img { width: 100%; max-width: 52rem; display: block; margin: 0 auto .6rem; }
figcaption { font-size: .9rem; max-width: 46rem; margin: 0 auto; }
figcaption b { color: var(--ink); }
.scroll { overflow-x: auto; }
table { border-collapse: collapse; font-size: .86rem; width: 100%; }
th, td { text-align: left; padding: .35rem .6rem; vertical-align: top;
  border-bottom: 1px solid var(--line); }
th { background: var(--pale); font-weight: 600; white-space: nowrap; }
td.n { text-align: right; font-variant-numeric: tabular-nums; white-space: nowrap; }
.v { display: inline-block; padding: 0 .5rem; border-radius: .7rem; color: #fff;
  font-size: .78rem; white-space: nowrap; }
.v.reproduced { background: #0072b2; } .v.not { background: #d55e00; }
.v.undecided { background: #8a8f98; }
pre { background: var(--pale); padding: .8rem 1rem; overflow-x: auto;
  border-radius: .4rem; font-size: .85rem; }
code { overflow-wrap: anywhere; }
@media print { main { max-width: none; padding: 0; } figure { break-inside: avoid; } }
"""


def report(
    tables: Mapping[str, pa.Table],
    figures: Sequence[DrawnFigure],
    command: str,
    when: datetime,
    versions: Mapping[str, str],
) -> str:
    """Return the report as HTML.

    Args:
        tables: by the names of ``outputs``; ``left_out`` contains figures, too.
        figures: in the order of the report.
        command: the command that made the report.
        when: its time, UTC.
        versions: versions of the software.
    """
    runs = tables["runs"].to_pylist()
    names = [label(name) for name in in_order(row["experiment"] for row in runs)]
    title = f"Revolve Islands: {', '.join(names)}" if names else "Revolve Islands"
    lead = (
        f"{len(runs)} runs, {sum(row['births'] for row in runs)} births; "
        f"written {when:%Y-%m-%d %H:%M} UTC"
    )
    sections = [
        f"<h1>{escape(title)}</h1>",
        f'<p class="lead">{escape(lead)}</p>',
        *_section("Runs", _runs(runs)),
        *_section("Findings of the thesis", _findings(tables["findings"].to_pylist())),
        *_section("Figures", *map(_figure, figures)),
        *_section("Left out", _left_out(tables["left_out"].to_pylist())),
        *_section("Tables", _contents(tables)),
        *_section("How this was made", _provenance(command, versions)),
    ]
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{_STYLE}</style>\n</head>\n"
        f"<body>\n<main>\n{chr(10).join(sections)}\n</main>\n</body>\n</html>\n"
    )


def _section(title: str, *content: str) -> list[str]:
    return [f"<h2>{title}</h2>", *content] if any(content) else []


def _table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return an HTML table of cells that are HTML already."""
    head = "".join(f"<th>{escape(name)}</th>" for name in heads)
    body = "\n".join(f"<tr>{''.join(row)}</tr>" for row in rows)
    return (
        f'<div class="scroll"><table><thead><tr>{head}</tr></thead>\n'
        f"<tbody>\n{body}\n</tbody></table></div>"
    )


def _cell(value: object) -> str:
    """Return a table cell; numbers are right-aligned, with 3 significant digits."""
    if isinstance(value, bool | str):
        return f"<td>{escape(str(value))}</td>"
    if value is None:
        return '<td class="n">–</td>'
    text = f"{value:.3g}" if isinstance(value, float) else str(value)
    return f'<td class="n">{text.replace("-", "&minus;")}</td>'


def _runs(runs: Sequence[Mapping[str, object]]) -> str:
    heads = ["experiment", "runs", "births of a run", "islands", "seeds"]
    heads += ["settings"] if any(row["differs"] for row in runs) else []
    rows = []
    for name in in_order(str(row["experiment"]) for row in runs):
        mine = [row for row in runs if row["experiment"] == name]
        # A folder does not say whether its run is still being executed.
        finished = [row["state"] == "finished" for row in mine].count(True)
        counts = {"finished": finished, "not finished": len(mine) - finished}
        states = ", ".join(f"{n} {state}" for state, n in counts.items() if n)
        births = sorted({int(str(row["births"])) for row in mine})
        reach = f"{births[0]}" if len(births) == 1 else f"{births[0]} to {births[-1]}"
        islands = max(int(str(row["islands"])) for row in mine)
        cells = (label(name), states, reach, islands, _seeds(mine), mine[0]["differs"])
        rows.append([_cell(value or "") for value in cells[: len(heads)]])
    return _table(heads, rows) if rows else ""


def _seeds(runs: Sequence[Mapping[str, object]]) -> str:
    """Return the seeds of an experiment's runs, and the repeats of each."""
    texts = []
    for seed in dict.fromkeys(row["seed"] for row in runs):
        repeats = sorted(int(str(row["run"])) for row in runs if row["seed"] == seed)
        which = f": repeats {', '.join(map(str, repeats))}" if any(repeats) else ""
        texts.append(f"{seed}{which}")
    return "; ".join(texts)


def _findings(rows: Sequence[Mapping[str, object]]) -> str:
    if not rows:
        return ""
    verdicts = [str(row["verdict"]) for row in rows]
    counts = ", ".join(
        f"{verdicts.count(verdict)} {verdict}"
        for verdict in ("reproduced", "not reproduced", "undecided")
    )
    numbers = ("mean_a", "mean_b", "effect", "effect_low", "effect_high", "q")
    lines = []
    for row in rows:
        verdict = str(row["verdict"])
        kind = verdict.split(maxsplit=1)[0]
        badge = f'<span class="v {kind}">{escape(verdict)}</span>'
        counts_of = (row["runs_a"], row["runs_b"])
        counted = " / ".join(str(count) for count in counts_of if count is not None)
        cells = [row[name] for name in ("figure", "claim", "expected")]
        cells += [counted or "–", *(row[name] for name in numbers)]
        lines.append([*map(_cell, cells), f"<td>{badge}</td>", _cell(row["why"])])
    heads = ("figure", "finding", "expected", "runs", "mean a", "mean b", "effect",
             "low", "high", "q", "verdict", "why")  # fmt: skip
    note = (
        "The unit is the run. The effect is Cliff's delta of a over b with its 95 % "
        "interval, or the rank-biserial correlation where one experiment is compared "
        "with a number. q is the p value, corrected for all tests of the table."
    )
    return f"<p><b>{counts}.</b> <span class=note>{escape(note)}</span></p>" + _table(
        heads, lines
    )


def _figure(drawn: DrawnFigure) -> str:
    one = drawn.figure
    picture = base64.b64encode(drawn.picture.read_bytes()).decode()
    tables = ", ".join(map(_source, one.source))
    name = f"Figure {one.number}. {one.title}."
    return (
        f'<figure id="figure-{escape(one.number)}">'
        f'<img alt="{escape(name)}" src="data:image/png;base64,{picture}">'
        f"<figcaption><b>{escape(name)}</b> {escape(one.caption)} "
        f"Source: {tables}.</figcaption></figure>"
    )


def _source(name: str) -> str:
    """Return a source; the name of a table of measures is set as code."""
    text = escape(name)
    return f"<code>{text}</code>" if name in OUTPUTS else text


def _left_out(rows: Sequence[Mapping[str, object]]) -> str:
    lines = [[_cell(row[name]) for name in ("what", "folder", "why")] for row in rows]
    return _table(("what", "run or file", "why"), lines) if lines else ""


def _contents(tables: Mapping[str, pa.Table]) -> str:
    rows = [
        [
            f"<td><code>measures/{name}.parquet</code></td>",
            _cell(tables[name].num_rows),
            _cell(", ".join(OUTPUTS[name])),
        ]
        for name in OUTPUTS
        if name in tables
    ]
    return _table(("file", "rows", "columns"), rows)


def _provenance(command: str, versions: Mapping[str, str]) -> str:
    rows = [[_cell(name), _cell(text)] for name, text in versions.items()]
    return f"<pre>{escape(command)}</pre>" + _table(("software", "version"), rows)
