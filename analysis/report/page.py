"""The report: one self-contained HTML file, without links to the network."""

import base64
import io
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from datetime import datetime
from html import escape
from importlib.resources import files
from pathlib import Path

import pyarrow.compute as pc
from PIL import Image

from analysis.figures.catalogue import DrawnFigure, Section
from analysis.figures.family_tree import Best
from analysis.figures.figure_writer import Drawings
from analysis.figures.forms import Tables
from analysis.figures.look import FAINT, INK, LOOK, RULE, dressed_in, in_look
from analysis.figures.robot_figures import GAITS, PART_COLOURS
from analysis.figures.style import in_order, label
from analysis.measures.fitness_functions import axis_text
from analysis.measures.outputs import OUTPUTS
from analysis.measures.winners import sustained_shares
from analysis.report.differences import all_differences, differences
from analysis.report.fitness import (
    fitness_over_births,
    last_populations,
    of_each_function,
    run_names,
)
from analysis.report.html import capitalised, cell, folded, number, table
from analysis.report.interactive import interactive
from analysis.report.overview import all_runs, arenas, speed, summary
from analysis.report.thesis import findings
from schema.errors import counted

_SHOWN_PIXELS = 1400
"""Width of figures in the report; their files are wider."""
_COLOURS = 128
"""Colours of plots in the report."""
_PLOT_IN = 4.6
"""Width of interactive plots [inches]."""
_WIDE = ("sweeps", "thesis")
"""Sections whose figures are as wide as the page, as that of gaits is."""

_COURSES = (
    "6.3",
    "Fitness over births",
    (
        "Thick lines are means over the runs of an experiment, as far as all its runs "
        "reach; bands are 95 % intervals of the mean of five or more runs. Thin lines "
        "are the mean fitness of single runs; of a run with several islands, the mean "
        "over them, as far as all of them reach. Dots are robots that were fitter than "
        "all robots born before them in their run."
    ),
)
_COURSES_OF_ARENAS = (
    " In arenas lines are means of the windows at each number of births. Each dot is "
    "at the birth of its robot; its height is the robot's greatest fitness at any "
    "later birth."
)
_LAST = (
    "6.2",
    "Fitness of the last populations",
    (
        "Each dot is a robot of a last population, each column of dots a run; bars are "
        "the means of runs."
    ),
)
"""Number of the figure, title and text of the interactive plots."""


def report(
    tables: Tables,
    drawings: Drawings,
    command: str,
    when: datetime,
    versions: Mapping[str, str],
) -> str:
    """Return the report as HTML, with the command, time and software that made it."""
    runs = tables["runs"].to_pylist()
    names = [label(name) for name in in_order(row["experiment"] for row in runs)]
    title = f"Revolve Islands: {', '.join(names)}" if names else "Revolve Islands"
    births = sum(row["births"] for row in runs)
    lead = (
        f"{counted(len(runs), 'run')}, {counted(births, 'birth')}; "
        f"written {when:%Y-%m-%d %H:%M} UTC"
    )
    every = _sections(tables, drawings, command, versions).items()
    sections = [(key, *section) for key, section in every if section[1]]
    links = "".join(
        f'<li><a href="#{key}">{head}</a></li>' for key, head, _ in sections
    )
    body = "\n".join(
        f'<section><h2 id="{key}">{head}</h2>\n{content}</section>'
        for key, head, content in sections
    )
    return (
        '<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        '<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>{_colours()}{_file('page.css')}"
        "</style>\n"
        f'</head>\n<body>\n<div id="page">\n<header><h1>{escape(title)}</h1>'
        f'<p class="lead">{escape(lead)}</p></header>\n<nav aria-label="Contents">'
        f"<ul>{links}</ul></nav>\n<main>\n{body}\n</main>\n</div>\n"
        f"<script>{_file('page.js')}</script>\n</body>\n</html>\n"
    )


def _colours() -> str:
    """Return the colours of the page, those of figures, as variables of CSS."""
    paint = {"ink": INK, "faint": "#5F6772", "rule": RULE, "line": FAINT,
             "pale": "#F6F7F9", "link": "#0B5CAD", "paper": "white"}  # fmt: skip
    lines = (f"--{name}: {in_look(colour)};" for name, colour in paint.items())
    return f":root {{ {' '.join(lines)} }}\n"


def _file(name: str) -> str:
    return files("analysis.report").joinpath(name).read_text("utf-8")


def _sections(
    tables: Tables, drawings: Drawings, command: str, versions: Mapping[str, str]
) -> dict[str, tuple[str, str]]:
    """Return heading and content of all sections by anchor, empty ones included."""
    by_number = {drawn.figure.number: drawn for drawn in drawings.figures}
    has_arena = tables["runs"]["simulated_s"].null_count < tables["runs"].num_rows
    over_births = (*_COURSES[:2], _COURSES[2] + _COURSES_OF_ARENAS * has_arena)
    courses = _of_functions(tables, fitness_over_births, over_births, by_number)
    last = _of_functions(tables, last_populations, _LAST, by_number)
    plots = {"6.3": courses, "6.2": last}
    installed = [[cell(name), cell(text)] for name, text in versions.items()]
    software = table(("software", "version"), installed)

    def shown(section: Section) -> str:
        content = "".join(
            _figure(drawn)
            for number, drawn in by_number.items()
            if drawn.figure.section == section and not plots.get(number)
        )
        return f'<div class="figures">{content}</div>' if content else ""

    return {
        "overview": ("Overview", _overview(tables, courses)),
        "sweeps": ("Sweeps", shown("sweeps")),
        "robots": ("Best robots", _films(tables, drawings) + shown("robots")),
        "fitness": ("Fitness", last + shown("fitness")),
        "comparison": ("Comparison", all_differences(tables)),
        "bodies": ("Bodies", shown("bodies")),
        "diversity": ("Diversity and ancestry", shown("diversity")),
        "islands": ("Islands and arenas", shown("islands")),
        "measures": ("Measures of the experiments", shown("measures") + _own(tables)),
        "learning": ("Lifetime learning", shown("learning")),
        "speed": ("Speed", speed(tables) + shown("speed")),
        "thesis": ("Findings of the thesis", findings(tables) + shown("thesis")),
        "runs": ("Runs", folded("All runs", all_runs(tables))),
        "left-out": ("Left out", _left_out(tables["left_out"].to_pylist())),
        "tables": ("Tables", folded("Files and columns", _contents(tables))),
        "made": ("How this was made", f"<pre>{escape(command)}</pre>{software}"),
    }


def _own(tables: Tables) -> str:
    rows = tables["named_measures"].to_pylist() if "named_measures" in tables else ()
    lines = {(row["measure"], row["about"]) for row in rows if row["about"]}
    return table(
        ("measure", "docstring"), [list(map(cell, one)) for one in sorted(lines)]
    )


def _overview(tables: Tables, courses: str) -> str:
    parts = (f"<div>{part}</div>" for part in (courses, differences(tables)) if part)
    both = "".join(parts)
    beside = f'<div class="duo">{both}</div>' if both else ""
    return summary(tables) + arenas(tables) + beside


def _of_functions(
    tables: Tables,
    draw: Callable[[Tables, str], str],
    about: tuple[str, str, str],
    drawn: Mapping[str, DrawnFigure],
) -> str:
    """Return an interactive plot for each fitness function, in place of a figure.

    It is empty if nothing can be drawn. ``about`` are the figure's number, the title
    and the text of the plot.
    """
    number, title, text = about
    groups = of_each_function(tables)
    # Narrow, so that texts are large.
    with dressed_in(replace(LOOK.get(), width_in=_PLOT_IN)):
        plots = {
            function: plot
            for function, mine in groups.items()
            if (plot := draw(mine, axis_text(function)))
        }
    figures = []
    for count, (function, plot) in enumerate(plots.items()):
        own = f": {escape(function)}" * (len(groups) > 1)
        caption = f"<b>{title}{own}.</b>"
        if count == len(plots) - 1:
            files_of = f" {_file_of(drawn[number])}" if number in drawn else ""
            caption += f" {text} A pointer on a mark shows run, seed and robot."
            caption += files_of
        anchor = f"figure-{number}" + f"-{count + 1}" * (count > 0)
        figures.append(
            f'<figure id="{anchor}">{plot}<figcaption>{caption}</figcaption></figure>'
        )
    return "".join(figures)


def _films(tables: Tables, drawings: Drawings) -> str:
    names = run_names(tables["runs"])
    arenas = tables["runs"].filter(pc.field("simulated_s").is_valid())
    folders = frozenset(arenas["folder"].to_pylist())
    shares = sustained_shares(tables["robots"])
    shown = "".join(
        _film(
            best,
            path,
            str(names[folder]),
            shares.get((folder, best.island)),
            has_arena=folder in folders,
        )
        for best, path in drawings.films
        if (folder := str(best.folder))
    )
    reasons = "".join(
        f"<p>{escape(label(name))}: no moving picture: {escape(why)}</p>"
        for name, why in drawings.no_films.items()
    )
    text = (
        "Each is the best robot of an experiment's last populations. "
        f"{PART_COLOURS} A tile of the floor has 10 cm."
    )
    note = f'<p class="note">{text}</p>'
    return (f'<div class="films">{shown}</div>{note}' if shown else "") + reasons


def _film(
    best: Best, path: Path, run: str, share: float | None, *, has_arena: bool
) -> str:
    data = base64.b64encode(path.read_bytes()).decode()
    name = f"Robot {best.birth_island}:{best.birth} of {best.folder.name} ({run})"
    if best.island != best.birth_island:
        name += f" on island {best.island}"
    lasting = "" if share is None else f", {100 * share:.0f} % of it in later windows"
    others = " Among the robots of an arena it may move differently." * has_arena
    return (
        f'<figure><img alt="{escape(name)}" src="data:image/gif;base64,{data}">'
        f"<figcaption><b>{escape(label(best.experiment))}: fitness "
        f"{number(best.fitness)}{lasting}.</b> {escape(name)}, simulated alone, "
        f"from the middle of its evaluation on.{others} "
        f"File: <code>figures/{escape(path.name)}</code>; "
        f'<a href="figures/{escape(path.stem)}.html">look from all sides</a>.'
        "</figcaption></figure>"
    )


def _figure(drawn: DrawnFigure) -> str:
    one = drawn.figure
    name = f"{one.title}."
    is_wide = one.number == GAITS or one.section in _WIDE or one.texts
    wide = ' class="wide"' if is_wide else ""
    caption = drawn.caption
    if one.texts:
        shown = interactive(one.draw({}), one.texts, name, "map")
        caption += " A pointer on a cell shows its robot."
    else:
        shown = f'<img loading="lazy" alt="{escape(name)}" src="{_embedded(drawn)}">'
    return (
        f'<figure id="figure-{escape(one.number)}"{wide}>{shown}'
        f"<figcaption><b>{escape(name)}</b> {escape(caption)} {_file_of(drawn)}"
        "</figcaption></figure>"
    )


def _file_of(drawn: DrawnFigure) -> str:
    one = drawn.figure
    thesis = f"figure {one.number} of the thesis; " * one.number[0].isdigit()
    first, *others = drawn.files
    text = f"{thesis}file <code>figures/{escape(first.name)}</code>"
    text += "".join(f", {file.suffix}" for file in others)
    sources = ", ".join(
        f"<code>{name}</code>" if name in OUTPUTS else escape(name)
        for name in one.source
    )
    return f"{capitalised(text)}; source: {sources}."


def _embedded(drawn: DrawnFigure) -> str:
    """Return a figure as a data URL: narrower than its file, and with fewer colours.

    Rendered robots are stored as WebP; lossless WebP of plots takes five times as long.
    """
    with Image.open(io.BytesIO(drawn.picture)) as picture:
        high = round(picture.height * min(1.0, _SHOWN_PIXELS / picture.width))
        size = (min(_SHOWN_PIXELS, picture.width), high)
        small = picture.convert("RGB").resize(size, Image.Resampling.LANCZOS)
    stored = io.BytesIO()
    kind = "webp" if drawn.figure.section == "robots" else "png"
    if kind == "webp":
        small.save(stored, kind, quality=80, method=0)
    else:
        few = small.quantize(_COLOURS, dither=Image.Dither.NONE)
        few.save(stored, kind)
    return f"data:image/{kind};base64,{base64.b64encode(stored.getvalue()).decode()}"


def _left_out(rows: Sequence[Mapping[str, object]]) -> str:
    lines = [[cell(row[name]) for name in ("what", "folder", "why")] for row in rows]
    content = table(("what", "run or file", "why"), lines)
    is_data = any(row["folder"] for row in rows)
    title = f"{counted(len(rows), 'item')} and why"
    return folded(title, content, is_open=is_data)


def _contents(tables: Tables) -> str:
    rows = [
        [
            f"<td><code>measures/{name}.parquet</code></td>",
            cell(tables[name].num_rows),
            cell(", ".join(OUTPUTS[name])),
        ]
        for name in OUTPUTS
        if name in tables
    ]
    return table(("file", "rows", "columns"), rows)
