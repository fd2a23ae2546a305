"""Pieces of HTML: tables, cells, numbers and durations."""

from collections.abc import Sequence
from html import escape

from analysis.figures.look import in_look
from analysis.figures.style import label

_NUMERIC = ' class="n"'


def table(heads: Sequence[str], rows: Sequence[Sequence[str]]) -> str:
    """Return an HTML table of cells that are HTML already; empty without rows."""
    if not rows:
        return ""
    head = "".join(
        f"<th{_NUMERIC * text.startswith(f'<td{_NUMERIC}')}>{escape(name)}</th>"
        for name, text in zip(heads, rows[0], strict=True)
    )
    body = "\n".join(f"<tr>{''.join(row)}</tr>" for row in rows)
    return (
        f'<div class="scroll"><table><thead><tr>{head}</tr></thead>\n'
        f"<tbody>\n{body}\n</tbody></table></div>"
    )


def cell(value: object) -> str:
    """Return a table cell; numbers are right-aligned, with 3 significant digits."""
    if isinstance(value, bool | str):
        return f"<td>{escape(str(value))}</td>"
    return f"<td{_NUMERIC}>{number(value)}</td>"


def number(value: object) -> str:
    """Return a number as HTML, floats with 3 significant digits; a dash for None."""
    if value is None:
        return "–"
    text = f"{value:.3g}" if isinstance(value, float) else str(value)
    return text.replace("-", "&minus;")


def duration(seconds: float | None) -> str:
    """Return a duration as text, for example ``4 min 10 s``."""
    if seconds is None:
        return "–"
    if seconds < 60:  # noqa: PLR2004 - seconds of a minute
        return f"{seconds:.0f} s" if seconds >= 1 else f"{seconds:.1f} s"
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours} h {minutes:02} min" if hours else f"{minutes} min {rest:02} s"


def folded(title: str, content: str, *, is_open: bool = False) -> str:
    """Return HTML that a click on its title shows; empty without content."""
    start = "<details open>" if is_open else "<details>"
    return f"{start}<summary>{escape(title)}</summary>{content}</details>" * bool(
        content
    )


def capitalised(text: str) -> str:
    """Return a text with a capital first letter."""
    return text[:1].upper() + text[1:]


def named(experiment: str, colour: str) -> str:
    """Return the name of an experiment beside its colour."""
    mark = f'<i style="background:{in_look(colour)}"></i>'
    return f"{mark}{escape(label(experiment))}"
