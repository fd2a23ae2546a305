"""What is shown while something goes on, on a terminal and in a log."""

import io

import pytest
from rich.console import Console

from analysis.progress import SPAN_S, ProgressLine, bars


def test_a_log_is_told_at_the_beginning_what_is_done(
    capsys: pytest.CaptureFixture[str],
) -> None:
    with bars("things [bold] to do: 3") as bar:
        assert list(bar.track(range(3))) == [0, 1, 2]
    told = capsys.readouterr()
    assert told.err == "things [bold] to do: 3\n"
    assert not told.out


def test_a_log_is_told_every_so_often_how_it_goes() -> None:
    log = io.StringIO()
    with ProgressLine(Console(file=log)) as line:
        for number, now_s in enumerate((5.0, 5.2, 4.9 + SPAN_S, 5.0 + SPAN_S)):
            line.update(f"[{number}] so far", now_s)
    assert log.getvalue() == "[0] so far\n[3] so far\n"


def test_a_terminal_is_shown_the_newest() -> None:
    screen = io.StringIO()
    console = Console(file=screen, force_terminal=True, width=60)
    with ProgressLine(console) as line:
        line.update("[1] so far", 0.0)
        line.update("[2] so far", 0.1)
        line.update("[3] so far", 0.2)
    assert "[3] so far" in screen.getvalue()
