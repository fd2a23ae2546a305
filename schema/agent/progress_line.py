"""Progress of one task: a line on a terminal that is updated, lines in a log."""

import math
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from threading import Event, Thread

from rich.console import Console
from rich.status import Status
from rich.text import Text

SPAN_S = 10.0
"""Time between two lines in a log [s]."""
SOON_S = 2.0
"""Time after which a task that is not done shows its progress [s]."""
_TURN_S = 0.2


class ProgressLine(AbstractContextManager["ProgressLine"]):
    """Progress of a task of unknown length; a context manager.

    A line that is updated on a terminal; in a log, a line every ``SPAN_S`` if it has
    changed.
    """

    def __init__(self, console: Console | None = None) -> None:
        self._console = console or Console(stderr=True)
        self._line = Status("", console=self._console)
        self._next_s = -math.inf
        self._last = ""

    def __exit__(self, *_: object) -> None:
        self._line.stop()

    def update(self, text: str, now_s: float) -> None:
        """Show the progress."""
        if self._console.is_terminal:
            self._line.start()
            self._line.update(Text(text))
        elif now_s >= self._next_s and text != self._last:
            self._next_s = now_s + SPAN_S
            self._last = text
            print_line(self._console, text)


@contextmanager
def progress_if_long(text: str) -> Iterator[Callable[[str], None]]:
    """Show the progress of a task that takes longer than ``SOON_S``.

    Yields:
        A function that takes the present progress in words, as often as it changes.
    """
    has_ended = Event()

    def tell(new: str) -> None:
        nonlocal text
        text = new

    def show() -> None:
        wait_s = SOON_S
        with ProgressLine() as line:
            while not has_ended.wait(wait_s):
                line.update(text, time.monotonic())
                wait_s = _TURN_S

    thread = Thread(target=show, daemon=True)
    thread.start()
    try:
        yield tell
    finally:
        has_ended.set()
        thread.join()


def print_line(console: Console, line: str) -> None:
    """Print a line without markup; a terminal wraps it, a file does not."""
    console.print(line, soft_wrap=True, markup=False, highlight=False)
