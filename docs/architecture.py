"""Draw the rooms, their packages and imports: docs/pictures/architecture.svg.

    python -m docs.architecture

Layers are those of the import contracts in pyproject.toml. Arrows are the imports of
the source files. The same sources give the same bytes.
"""

from collections.abc import Sequence

from docs.architecture_plan import GAP, Plan, Point, plan_of
from docs.architecture_rooms import ROOT, Room, rooms

PICTURE = ROOT / "docs" / "pictures" / "architecture.svg"

_ABOUT = {
    "coordinator": "births, survival, who does what",
    "worker": "motion and fitness",
    "analyzer": "vetting of bodies",
    "analysis": "measures, figures, viewer",
    "schema": "what processes and files agree on",
}
_HEAD, _MAIN, _PAD = 46.0, 44.0, 10.0
_COLOURS = (
    "#0b6e99", "#b3541e", "#5b7f1f", "#7a4fa3", "#a8324a", "#8a6d00", "#3b5bbd",
    "#2f7d6b", "#96407f", "#5f6a72",
)  # fmt: skip


class _Canvas:
    """Lines of an SVG, arrows before boxes before text."""

    def __init__(self) -> None:
        self.layers: tuple[list[str], ...] = ([], [], [], [])

    def box(
        self, corner: Point, size: Point, kind: str, *, layer: int = 2, round_: int = 6
    ) -> None:
        """Add a rectangle."""
        (x, y), (width, height) = corner, size
        self.layers[layer].append(
            f'<rect class="{kind}" x="{x:.1f}" y="{y:.1f}" width="{width:.1f}" '
            f'height="{height:.1f}" rx="{round_}"/>'
        )

    def text(self, at: Point, words: str, kind: str) -> None:
        """Add a line of text."""
        self.layers[3].append(
            f'<text class="{kind}" x="{at[0]:.1f}" y="{at[1]:.1f}">{words}</text>'
        )

    def arrow(self, corners: Sequence[Point], colour: int) -> None:
        """Add an arrow with round corners."""
        self.layers[1].append(
            f'<path class="a" d="{_rounded(corners)}" stroke="{_COLOURS[colour]}" '
            f'marker-end="url(#h{colour})"/>'
        )


def _rounded(corners: Sequence[Point]) -> str:
    """Return the path through corners, each of which is cut off roundly."""
    path = [f"M{corners[0][0]:.1f} {corners[0][1]:.1f}"]
    for before, at, after in zip(corners, corners[1:], corners[2:], strict=False):
        inward, outward = _towards(at, before), _towards(at, after)
        path.append(
            f"L{inward[0]:.1f} {inward[1]:.1f}"
            f"Q{at[0]:.1f} {at[1]:.1f} {outward[0]:.1f} {outward[1]:.1f}"
        )
    return "".join([*path, f"L{corners[-1][0]:.1f} {corners[-1][1]:.1f}"])


def _towards(at: Point, other: Point) -> Point:
    """Return the point a few pixels from one corner towards another."""
    length = abs(other[0] - at[0]) + abs(other[1] - at[1])
    share = min(4.0, length / 2) / length if length else 0.0
    return at[0] + (other[0] - at[0]) * share, at[1] + (other[1] - at[1]) * share


def _put(
    canvas: _Canvas, room: Room, plan: Plan, corner: Point, *, is_lying: bool
) -> None:
    """Draw the boxes and arrows of a room.

    Args:
        canvas: where to.
        room: whose names and numbers of files are written.
        plan: where everything lies.
        corner: of the first layer.
        is_lying: the layers go from left to right, not from top to bottom.
    """

    def placed(along: float, across: float) -> Point:
        x, y = (along, across) if is_lying else (across, along)
        return corner[0] + x, corner[1] + y

    order = [box for names in room.layers for box in names]
    for box, (begin, low, high) in plan.boxes.items():
        start, end = placed(begin, low), placed(begin + plan.box, high)
        size = (end[0] - start[0], end[1] - start[1])
        count = room.files[box]
        canvas.box(start, size, "p" if count else "f")
        middle = (start[0] + size[0] / 2, start[1] + size[1] / 2)
        if count:
            canvas.text((middle[0], middle[1] - 2), box, "n")
            canvas.text((middle[0], middle[1] + 12), f"{count} files", "s")
        else:
            canvas.text((middle[0], middle[1] + 4), f"{box}.py", "m")
    for importer, corners in plan.arrows:
        line = [placed(along, across) for along, across in corners]
        canvas.arrow(line, order.index(importer) % len(_COLOURS))


def draw() -> str:
    """Return the picture as SVG."""
    *upper, base = rooms()
    canvas = _Canvas()
    plans = [plan_of(room, along=40.0, across=112.0) for room in upper]
    lying = plan_of(base, along=122.0, across=38.0)
    widths = [plan.breadth + 2 * _PAD for plan in plans]
    width = sum(widths) + (len(widths) - 1) * 12.0
    inner = max(plan.length for plan in plans)
    top = 46.0
    canvas.box((0, 0), (width, 34), "c")
    canvas.text((width / 2, 22), _COMPOSES, "t")
    height = _HEAD + _MAIN + GAP / 2 + inner + _PAD
    x = 0.0
    for room, plan, wide in zip(upper, plans, widths, strict=True):
        canvas.box((x, top), (wide, height), "r", layer=0, round_=10)
        _head(canvas, room, (x + 14, top))
        canvas.box((x + _PAD, top + _HEAD), (wide - 2 * _PAD, _MAIN - 8), "c")
        _main(canvas, room, (x + wide / 2, top + _HEAD))
        start = (x + _PAD, top + _HEAD + _MAIN + GAP / 2)
        _put(canvas, room, plan, start, is_lying=False)
        bottom = top + height
        canvas.layers[1].append(
            f'<path class="b" d="M{x + wide / 2:.1f} {bottom:.1f}v26"/>'
        )
        x += wide + 12.0
    top += height + 36.0
    height = _HEAD + lying.breadth + _PAD
    canvas.box((0, top), (width, height), "r", layer=0, round_=10)
    _head(canvas, base, (14, top))
    canvas.box((width - 140 - _PAD, top + _PAD), (140, 26), "c")
    canvas.text((width - 70 - _PAD, top + _PAD + 17), "__main__.py", "m")
    start = ((width - lying.length) / 2, top + _HEAD)
    _put(canvas, base, lying, start, is_lying=True)
    return _document(canvas, (width, top + height))


_COMPOSES = "revolve/: the command and the Python API; it and a __main__ combine rooms"


def _head(canvas: _Canvas, room: Room, corner: Point) -> None:
    x, y = corner
    canvas.text((x, y + 20), f"{room.name}/", "h")
    canvas.text((x, y + 36), f"{_ABOUT[room.name]}", "l")


def _main(canvas: _Canvas, room: Room, at: Point) -> None:
    x, y = at
    if not room.composes:
        canvas.text((x, y + 22), "__main__.py", "m")
        return
    others = sorted({name.partition(".")[0] for name in room.composes})
    canvas.text((x, y + 15), "__main__.py", "m")
    canvas.text((x, y + 29), f"also imports {', '.join(others)}", "s")


_STYLE = (
    "text{font-family:Helvetica,Arial,'DejaVu Sans',sans-serif;text-anchor:middle;"
    "fill:#1f2933}"
    ".h{font-size:17px;font-weight:bold;text-anchor:start}"
    ".l{font-size:12px;text-anchor:start;fill:#52606d}"
    ".n{font-size:14px;font-weight:bold}.m{font-size:11.5px}.t{font-size:13px}"
    ".s{font-size:11px;fill:#52606d}"
    ".r{fill:#f3f5f7;stroke:#c3ccd5}.c{fill:#e4e9ee;stroke:#c3ccd5}"
    ".p{fill:#fff;stroke:#52606d;stroke-width:1.3}.f{fill:#fff;stroke:#9aa5b1}"
    ".a{fill:none;stroke-width:1.4}.b{stroke:#52606d;stroke-width:5;"
    "marker-end:url(#hb)}"
)


def _document(canvas: _Canvas, size: Point) -> str:
    """Return the SVG with a margin, on a ground that suits light and dark pages."""
    width, height = size[0] + 32, size[1] + 32
    heads = [(str(number), colour, 7) for number, colour in enumerate(_COLOURS)]
    markers = [
        f'<marker id="h{name}" viewBox="0 0 8 8" refX="7.2" refY="4" '
        f'markerWidth="{large}" markerHeight="{large}" markerUnits="userSpaceOnUse" '
        f'orient="auto"><path d="M0 0.6L8 4L0 7.4z" fill="{colour}"/></marker>'
        for name, colour, large in [*heads, ("b", "#52606d", 16)]
    ]
    return "\n".join(
        [
            (
                f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="-16 -16 {width:.0f} '
                f'{height:.0f}" width="{width:.0f}" height="{height:.0f}" role="img">'
            ),
            "<title>Rooms of Revolve Islands, their packages and imports</title>",
            f"<style>{_STYLE}</style>",
            f"<defs>{''.join(markers)}</defs>",
            (
                f'<rect x="-16" y="-16" width="{width:.0f}" height="{height:.0f}" '
                'rx="12" fill="#fff"/>'
            ),
            *(line for layer in canvas.layers for line in layer),
            "</svg>",
            "",
        ]
    )


if __name__ == "__main__":
    PICTURE.write_text(draw(), "utf-8")
