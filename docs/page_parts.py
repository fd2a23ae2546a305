"""Generated parts of the pages of docs, and the rows that they are made from.

A part is between two comments that name it.
"""

import csv
import re
from collections.abc import Iterable, Mapping
from pathlib import Path

_PART = re.compile(r"(<!-- begin: ([\w -]+) -->\n).*?(<!-- end -->)", re.DOTALL)


def with_parts(page: str, parts: Mapping[str, Iterable[str]]) -> str:
    """Return a page with new generated parts.

    Args:
        page: its text, with each part once.
        parts: lines of each part, by name.

    Raises:
        ValueError: the page has other parts.
    """
    found = [name for _, name, _ in _PART.findall(page)]
    if sorted(found) != sorted(parts):
        raise ValueError(f"the page must have parts {sorted(parts)}, has {found}")
    texts = {name: "\n".join([*lines, ""]) for name, lines in parts.items()}
    return _PART.sub(lambda part: f"{part[1]}{texts[part[2]]}{part[3]}", page)


def write_parts(
    path: Path, parts: Mapping[str, Iterable[str]], command: str, *, is_check: bool
) -> int:
    """Write the generated parts of a page; return 0.

    Args:
        path: of the page.
        parts: as for ``with_parts``.
        command: that writes the page, for a message.
        is_check: write nothing, and return 1 if a part differs.
    """
    old = path.read_text("utf-8")
    page = with_parts(old, parts)
    if not is_check:
        path.write_text(page, "utf-8")
    elif page != old:
        print(f"{path.name}: not up to date, run {command}")
        return 1
    return 0


def csv_rows(file: Path) -> list[dict[str, str]]:
    """Return the rows of a CSV file; none if it does not exist."""
    if not file.exists():
        return []
    with file.open(newline="", encoding="utf-8") as rows:
        return list(csv.DictReader(rows))
