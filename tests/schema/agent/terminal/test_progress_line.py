"""Tests of the progress of one task on a terminal and in a log."""

import io
import time

import pytest
from rich.console import Console

from schema.agent.terminal.progress_line import SPAN_S, ProgressLine, progress_if_long


def test_a_log_of_one_line_repeats_it_only_if_it_has_changed() -> None:
    log = io.StringIO()
    with ProgressLine(Console(file=log)) as line:
        for text, now_s in (("a", 0.0), ("a", SPAN_S), ("b", SPAN_S + 1.0)):
            line.update(text, now_s)
    assert log.getvalue() == "a\nb\n"


def test_a_log_shows_progress_at_intervals() -> None:
    log = io.StringIO()
    with ProgressLine(Console(file=log)) as line:
        for number, now_s in enumerate((5.0, 5.2, 4.9 + SPAN_S, 5.0 + SPAN_S)):
            line.update(f"[{number}] so far", now_s)
    assert log.getvalue() == "[0] so far\n[3] so far\n"


def test_a_terminal_shows_the_newest_progress() -> None:
    screen = io.StringIO()
    console = Console(file=screen, force_terminal=True, width=60)
    with ProgressLine(console) as line:
        line.update("[1] so far", 0.0)
        line.update("[2] so far", 0.1)
        line.update("[3] so far", 0.2)
    assert "[3] so far" in screen.getvalue()


def test_only_a_long_task_shows_its_newest_progress(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    with progress_if_long("0 of 9") as tell:
        tell("1 of 9")
    assert capsys.readouterr() == ("", "")
    monkeypatch.setattr("schema.agent.terminal.progress_line.SOON_S", 0.05)
    with progress_if_long("0 of 9") as tell:
        tell("1 of 9")
        time.sleep(0.5)
        tell("2 of 9")
    assert capsys.readouterr() == ("", "1 of 9\n")
