"""Generated parts of the pages of docs."""

from collections.abc import Iterable, Mapping


def with_parts(page: str, parts: Mapping[str, Iterable[str]]) -> str:
    """Return a page with new lines between ``<!-- begin: NAME -->`` and the next end.

    Args:
        page: its text.
        parts: lines of each part, by name.
    """
    for name, lines in parts.items():
        begin, end = f"<!-- begin: {name} -->\n", "<!-- end -->"
        head, _, rest = page.partition(begin)
        _, _, tail = rest.partition(end)
        page = "".join([head, begin, *(f"{line}\n" for line in lines), end, tail])
    return page
