"""How far a long command is, on standard error: bars, or lines in a log."""

import math
from collections.abc import Iterator
from contextlib import contextmanager
from types import TracebackType
from typing import Self

from rich.console import Console
from rich.progress import Progress, ProgressColumn
from rich.status import Status
from rich.text import Text

SPAN_S = 10.0
"""Time between two lines in a log [s]."""


@contextmanager
def bars(what: str, *columns: str | ProgressColumn) -> Iterator[Progress]:
    """Show bars while something is done; in a log say once what.

    Args:
        what: is done.
        columns: of the bars; rich's own if none are given.
    """
    console = Console(stderr=True)
    if not console.is_terminal:
        _print(console, what)
    with Progress(
        *columns, console=console, transient=True, disable=not console.is_terminal
    ) as progress:
        yield progress


class ProgressLine:
    """What goes on until it ends by itself; use it in a ``with``.

    On a terminal a line that changes, in a log one every ``SPAN_S``.
    """

    def __init__(self, console: Console | None = None) -> None:
        """Show nothing yet.

        Args:
            console: to show it on; standard error if not given.
        """
        self._console = console or Console(stderr=True)
        self._line = Status("", console=self._console)
        self._next_s = -math.inf

    def __enter__(self) -> Self:
        """Return itself; nothing is drawn before there is something to tell."""
        return self

    def __exit__(
        self,
        kind: type[BaseException] | None,
        error: BaseException | None,
        trace: TracebackType | None,
    ) -> None:
        """Take the line away."""
        self._line.stop()

    def tell(self, how: str, now_s: float) -> None:
        """Show how it goes.

        Args:
            how: in words.
            now_s: the time, of any clock that only goes forward [s].
        """
        if self._console.is_terminal:
            self._line.start()
            self._line.update(Text(how))
        elif now_s >= self._next_s:
            self._next_s = now_s + SPAN_S
            _print(self._console, how)


def _print(console: Console, line: str) -> None:
    console.print(line, soft_wrap=True, markup=False, highlight=False)
