"""Levels of a family put in order by Graphviz's dot, where that is installed."""

import shutil
import subprocess
from collections.abc import Sequence

from schema.errors import RevolveError

_PATIENCE_S = 20.0


class NoDot(RevolveError):  # noqa: N818 - reads as what it says
    """Graphviz's dot is not installed, or does not answer."""


def ordered_by_dot(
    levels: Sequence[Sequence[int]], edges: Sequence[tuple[int, int]]
) -> list[list[int]]:
    """Return the levels, each from left to right as dot lays them out.

    Args:
        levels: from below.
        edges: (child, parent).

    Raises:
        NoDot: it is not installed, or does not answer as it should.

    Source: Gansner, Koutsofios, North, Vo, *A technique for drawing directed graphs*,
    IEEE Transactions on Software Engineering 19(3), 1993.
    """
    program = shutil.which("dot")
    if program is None:
        raise NoDot("dot is not installed")
    try:
        answer = subprocess.run(  # noqa: S603 - our own text, to a program by its name
            [program, "-Tplain"],
            input=_graph(levels, edges),
            capture_output=True,
            text=True,
            check=True,
            timeout=_PATIENCE_S,
        ).stdout
        words = [line.split() for line in answer.splitlines()]
        places = {int(w[1]): float(w[2]) for w in words if w[0] == "node"}
        return [sorted(level, key=places.__getitem__) for level in levels]
    except (OSError, subprocess.SubprocessError, ValueError, LookupError) as error:
        raise NoDot(f"dot does not answer as it should: {error}") from None


def _graph(levels: Sequence[Sequence[int]], edges: Sequence[tuple[int, int]]) -> str:
    """Return a family in dot's language; only lines upwards tell who stands above."""
    height = {one: at for at, level in enumerate(levels) for one in level}
    lines = ["digraph { rankdir=BT; node [shape=box];"]
    lines += [
        "{ rank=same; " + " ".join(f"{one};" for one in level) + " }"
        for level in levels
    ]
    for child, parent in edges:
        kind = "" if height[parent] > height[child] else " [constraint=false]"
        lines.append(f"{child} -> {parent}{kind};")
    return "\n".join([*lines, "}"])
