"""Names of the files of figures and films, which names of experiments determine."""

import re
from itertools import chain, count

_MOST_BYTES = 100
"""Length of a name: file systems allow 255 bytes, endings included."""


def file_name(text: str) -> str:
    """Return a text as the name of a file without ending: safe and not too long.

    Args:
        text: words, which hyphens join in the name.
    """
    name = "-".join(re.findall(r"[\w.~+=]+", text))
    return name.encode()[:_MOST_BYTES].decode(errors="ignore")


class FileNames:
    """Distinct names of files, also where case does not count."""

    def __init__(self) -> None:
        """Initialise without names."""
        self._taken: set[str] = set()

    def add(self, text: str) -> str:
        """Return ``file_name``, with a number behind it if that name is taken."""
        name = file_name(text)
        numbered = (f"{name}-{number}" for number in count(2))
        free = next(
            each
            for each in chain([name], numbered)
            if each.casefold() not in self._taken
        )
        self._taken.add(free.casefold())
        return free
