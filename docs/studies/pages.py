"""What studies share: parts of pages, tables, kept rows, small pictures, the command.

A generated part of a page is between two comments that name it.
"""

import argparse
import csv
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

DOCS = Path(__file__).resolve().parents[1]
ROOT = DOCS.parent
PICTURES = DOCS / "pictures"
_PART = re.compile(r"(<!-- begin: ([\w -]+) -->\n).*?(<!-- end -->)", re.DOTALL)
_WIDTH, _COLOURS = 1400, 64
"""Pixels across a picture, and its number of colours."""

Parts = Mapping[str, Iterable[str]]
"""Lines of each generated part of a page, by name."""


def with_parts(page: str, parts: Parts) -> str:
    """Return a page with new generated parts.

    Args:
        page: its text, with each part once; it may have parts of other studies.
        parts: the parts.

    Raises:
        ValueError: the page lacks a part.
    """
    found = [name for _, name, _ in _PART.findall(page)]
    if lacking := sorted(set(parts) - set(found)):
        raise ValueError(f"the page must have parts {lacking}, has {found}")
    texts = {name: "\n".join([*lines, ""]) for name, lines in parts.items()}

    def filled(part: re.Match[str]) -> str:
        return f"{part[1]}{texts[part[2]]}{part[3]}" if part[2] in texts else part[0]

    return _PART.sub(filled, page)


def stale_pages(pages: Mapping[str, Parts]) -> list[str]:
    """Return the names of the pages whose generated parts are others."""
    texts = {name: (DOCS / name).read_text("utf-8") for name in pages}
    return [
        name for name in pages if with_parts(texts[name], pages[name]) != texts[name]
    ]


def write_pages(pages: Mapping[str, Parts]) -> None:
    """Write the generated parts of pages, by name of the file in docs/."""
    for name, parts in pages.items():
        page = with_parts((DOCS / name).read_text("utf-8"), parts)
        (DOCS / name).write_text(page, "utf-8")
        print(name)


def markdown(heads: Sequence[str], rows: Iterable[Sequence[str]]) -> list[str]:
    """Return the lines of a table."""
    lines = [f"| {' | '.join(cells)} |" for cells in (heads, *rows)]
    return [lines[0], "|---" * len(heads) + "|", *lines[1:]]


def csv_rows(file: Path) -> list[dict[str, str]]:
    """Return the rows of a CSV file; none if it does not exist."""
    if not file.exists():
        return []
    with file.open(newline="", encoding="utf-8") as rows:
        return list(csv.DictReader(rows))


def append_csv(file: Path, row: Mapping[str, object]) -> None:
    """Append a row to a CSV file, which begins with the names of its columns."""
    file.parent.mkdir(exist_ok=True)
    is_new = not file.exists()
    with file.open("a", newline="", encoding="utf-8") as rows:
        writer = csv.DictWriter(rows, [*row], lineterminator="\n")
        if is_new:
            writer.writeheader()
        writer.writerow(row)


def save_small(figure: Any, name: str) -> None:  # noqa: ANN401 - plotnine has no types
    """Write a picture of few colours into the folder of pictures."""
    from PIL import Image  # noqa: PLC0415 - of an extra

    from analysis.figures.style import save  # noqa: PLC0415

    with TemporaryDirectory() as place:
        save(figure, Path(place) / name)
        with Image.open(Path(place) / f"{name}.png") as drawn:
            wide, high = _WIDTH, _WIDTH * drawn.height // drawn.width
            small = drawn.convert("RGB").resize((wide, high), Image.Resampling.LANCZOS)
    few = small.quantize(_COLOURS, Image.Quantize.MAXCOVERAGE)
    few.save(PICTURES / f"{name}.png", optimize=True)
    print(f"{PICTURES.name}/{name}.png")


def command(
    about: str | None,
    pages: Callable[[], Mapping[str, Parts]],
    draw: Callable[[], object] | None = None,
    **others: tuple[str, Callable[[list[Path]], object]],
) -> Callable[[Sequence[str] | None], int]:
    """Return the ``main`` of a study: ``page [--check]``, and further commands.

    Args:
        about: docstring of the study.
        pages: returns the generated parts of its pages.
        draw: writes its pictures.
        others: help of each further command, and a function of the paths given to it.

    Returns:
        A function of the words of the command line, which returns 0, or 1 if a page is
        not up to date.
    """
    parser = argparse.ArgumentParser(description=(about or "").partition("\n")[0])
    commands = parser.add_subparsers(dest="command", required=True)
    for name, (text, _) in others.items():
        made = commands.add_parser(name, help=text)
        made.add_argument("paths", type=Path, nargs="*", help="files or folders")
    writing = commands.add_parser("page", help="write tables and pictures")
    writing.add_argument("--check", action="store_true", help="write nothing; compare")

    def main(words: Sequence[str] | None = None) -> int:
        options = parser.parse_args(words)
        if options.command in others:
            others[options.command][1](options.paths)
        elif options.check:
            stale = stale_pages(pages())
            for name in stale:
                print(f"{name}: not up to date, run the command page")
            return 1 if stale else 0
        else:
            write_pages(pages())
            if draw is not None:
                draw()
        return 0

    return main
