"""Command line flags of ``revolve analyze``; needs no plotting library."""

import argparse
from pathlib import Path

from schema.agent.flags import Flags, add_count, add_plugins

WIDTHS_IN = {"column": 3.5, "page": 7.2}
"""Widths of a paper's column and page [inches]."""
STYLES = ("light", "dark", "print")
FORMATS = ("pdf", "png", "svg")


def parser(_command: str = "analyze") -> Flags:
    """Return the parser of ``revolve analyze``."""
    flags = Flags(
        prog="revolve analyze",
        description="Measure runs, compare experiments, draw the thesis's figures, and "
        "write a report.",
        examples=(
            "revolve analyze runs/scenario1-seed1",
            "revolve analyze runs/a runs/b --out report --processes 2",
            "revolve analyze runs arena.parquet    # with a file of revolve bench",
            "revolve analyze runs --figures 6.3,H --width column --format pdf",
        ),
    )
    flags.add_argument(
        "runs",
        nargs="+",
        type=Path,
        metavar="FOLDER",
        help="run or campaign folder, or a folder that contains some; also files that "
        "'revolve bench arena --out FILE' wrote",
    )
    flags.add_argument(
        "--out",
        type=Path,
        default=Path("report"),
        metavar="FOLDER",
        help="folder to write to (default: report)",
    )
    flags.add_argument(
        "--figures", type=_names, default=(), metavar="N,...",
        help="draw only these figures, such as 6.3,H (default: all)",
    )  # fmt: skip
    flags.add_argument(
        "--width", choices=(*WIDTHS_IN,), default="page",
        help="width of figures: a paper's column, 3.5 inches, or page, 7.2 inches "
        "(default: page)",
    )  # fmt: skip
    flags.add_argument(
        "--format", type=_formats, default=("pdf", "png"), metavar="F,...",
        help=f"formats of figures: {', '.join(FORMATS)} (default: pdf,png)",
    )  # fmt: skip
    flags.add_argument(
        "--style", choices=STYLES, default="light",
        help="look of figures and report; print is grey, with line styles and "
        "hatching (default: light)",
    )  # fmt: skip
    flags.add_argument(
        "--colours", type=_names, default=(), metavar="C,...",
        help="colours of the experiments in the order of legends, such as "
        "'#0072B2,orange', or the name of a colour map of matplotlib, such as tab10",
    )  # fmt: skip
    flags.add_argument(
        "--slots",
        choices=("parent", "own"),
        default="parent",
        help="slot that labels a part in the tree edit distance between bodies: its "
        "parent's, as in the thesis (default), or its own, as in the published code",
    )
    what = "number of processes, which measure runs in parallel"
    add_count(flags, "--processes", None, f"{what} (default: number of cores)")
    add_plugins(flags)
    return flags


def _names(text: str) -> tuple[str, ...]:
    return tuple(name.strip() for name in text.split(","))


def _formats(text: str) -> tuple[str, ...]:
    if set(names := _names(text)) <= set(FORMATS):
        return names
    allowed = ", ".join(FORMATS)
    raise argparse.ArgumentTypeError(f"must be of {allowed}, got {text[:80]!r}")
