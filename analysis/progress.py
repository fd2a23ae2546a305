"""Progress of long commands on standard error: bars on a terminal, lines in a log."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Self

from rich.console import Console
from rich.progress import Progress, ProgressColumn
from rich.status import Status
from rich.text import Text

SPAN_S = 10.0
"""Time between two lines in a log [s]."""


@contextmanager
def bars(title: str, *columns: str | ProgressColumn) -> Iterator[Progress]:
    """Show progress bars on a terminal; print a title once in a log.

    Args:
        title: text printed in a log.
        columns: columns of the bars; rich's default if none are given.
    """
    console = Console(stderr=True)
    if not console.is_terminal:
        print_line(console, title)
    with Progress(
        *columns, console=console, transient=True, disable=not console.is_terminal
    ) as progress:
        yield progress


class ProgressLine:
    """Progress of a task of unknown length; a context manager.

    A line that is updated on a terminal, a line every ``SPAN_S`` in a log.

    Args:
        console: console to print on; standard error by default.
    """

    def __init__(self, console: Console | None = None) -> None:
        self._console = console or Console(stderr=True)
        self._line = Status("", console=self._console)
        self._next_s = -math.inf

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._line.stop()

    def update(self, text: str, now_s: float) -> None:
        """Show the progress.

        Args:
            text: the progress in words.
            now_s: time of a monotonic clock [s].
        """
        if self._console.is_terminal:
            self._line.start()
            self._line.update(Text(text))
        elif now_s >= self._next_s:
            self._next_s = now_s + SPAN_S
            print_line(self._console, text)


def print_line(console: Console, line: str) -> None:
    """Print a line without markup; a terminal wraps it, a file does not."""
    console.print(line, soft_wrap=True, markup=False, highlight=False)
