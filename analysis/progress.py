"""Progress of long commands: bars on a terminal, lines in a log, what is replaced."""

from collections.abc import Iterator
from contextlib import contextmanager, nullcontext
from datetime import UTC, datetime
from pathlib import Path
from threading import Event, Thread

from rich.console import Console
from rich.progress import Progress, ProgressColumn, Task

from schema.agent.progress_line import SPAN_S, print_line


def replaced(file: Path, what: str, others: str) -> Iterator[str]:
    """Yield a line that a file of an earlier command, and others, are replaced."""
    if file.is_file():
        written = datetime.fromtimestamp(file.stat().st_mtime, UTC)
        text = f"replaces {what} of {written:%Y-%m-%d %H:%M} UTC, {others}"
        yield f"{file}: {text}; to keep them, give another folder: --out"


@contextmanager
def bars(title: str, *columns: str | ProgressColumn) -> Iterator[Progress]:
    """Show progress bars on a terminal; in a log, a title, and lines at intervals."""
    console = Console(stderr=True)
    is_log = not console.is_terminal
    if is_log:
        print_line(console, title)
    # A thread that refreshes is what counts otherwise, and it does not run in a log.
    progress = Progress(
        *columns,
        console=console,
        transient=True,
        disable=is_log,
        auto_refresh=not is_log,
    )
    with progress, _lines(progress, console) if is_log else nullcontext():
        yield progress


@contextmanager
def _lines(progress: Progress, console: Console) -> Iterator[None]:
    """Print a line about the unfinished tasks every ``SPAN_S`` if it has changed."""
    has_ended = Event()

    def tell() -> None:
        last = ""
        while not has_ended.wait(SPAN_S):
            unfinished = [task for task in progress.tasks if not task.finished]
            line = "; ".join(map(_count, unfinished))
            if line and line != last:
                print_line(console, line)
                last = line

    thread = Thread(target=tell, daemon=True)
    thread.start()
    try:
        yield
    finally:
        has_ended.set()
        thread.join()


def _count(task: Task) -> str:
    """Return how far a task is, such as ``runs: 2 of 5``, or as a percentage."""
    if task.total is None:
        return task.description
    if task.completed % 1.0:
        return f"{task.description}: {task.percentage:.0f} %"
    return f"{task.description}: {task.completed:g} of {task.total:g}"
