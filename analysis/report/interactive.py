"""Figures as interactive plots of the page: SVG with texts that a pointer shows.

SVG was chosen over a plotting library in the page because the report stays one small
file (plotly.js alone has 4.7 MB), is readable without scripts, and prints. Each mark
has a ``<title>``, which browsers show by themselves; ``page.js`` shows it at once.
"""

import re
from collections.abc import Mapping, Sequence
from html import escape
from typing import Any

from analysis.figures.style import stored

_TAG, _DECIMALS = re.compile("<[^>]*>"), re.compile(r"(\.\d\d)\d+")


def interactive(
    figure: Any,  # noqa: ANN401 - of two libraries
    texts: Mapping[str, str | Sequence[str]],
    description: str,
    kind: str = "",
) -> str:
    """Return a figure as SVG.

    Args:
        figure: drawn in the colours of light pages.
        texts: by the ``gid`` of artists; of points one each, in their order. The first
            word of a gid is its class in the style sheet.
        description: for screen readers.
        kind: class of the whole plot in the style sheet.
    """
    svg = stored(figure, ["svg"])["svg"].decode()
    box = re.findall(r'viewBox="([^"]*)"', svg)[0]
    head, *groups = svg[svg.index("<defs>") :].split('<g id="')
    plain = re.sub(r"<metadata>.*?</metadata>", "", head, flags=re.DOTALL)
    content = plain + "".join(_group(each, texts) for each in groups)
    # Coordinates need no more decimals; texts keep theirs.
    short = _TAG.sub(lambda tag: _DECIMALS.sub(r"\1", tag[0]), content)
    return (
        f'<svg class="{f"plot {kind}".strip()}" viewBox="{box}" role="img" '
        f'aria-label="{escape(description)}">{short}'
    )


def _group(group: str, texts: Mapping[str, str | Sequence[str]]) -> str:
    """Return the SVG of an artist with its texts; ids would not be of one figure."""
    name, _, rest = group.partition('"')
    text = texts.get(name)
    if text is None:
        return f"<g{rest}"
    shape, _, content = rest.partition(">")
    start = f'<g class="{name.partition("-")[0]}"{shape}>'
    if isinstance(text, str):
        return f"{start}{_title(text)}{content}"
    each = iter(text)
    return start + re.sub(
        r"<use [^>]*/>", lambda use: f"<g>{_title(next(each))}{use[0]}</g>", content
    )


def _title(text: str) -> str:
    return f"<title>{escape(text)}</title>"
