"""Tests of progress on a terminal and in a log."""

from threading import Event

import pytest

from analysis.progress import bars


@pytest.fixture
def lines(monkeypatch: pytest.MonkeyPatch) -> list[str]:
    """Return the list that gets the lines of a log, which come quickly."""
    found: list[str] = []
    monkeypatch.setattr("analysis.progress.SPAN_S", 0.01)
    monkeypatch.setattr(
        "analysis.progress.print_line", lambda _console, line: found.append(line)
    )
    return found


def wait_for(line: str, lines: list[str]) -> None:
    """Wait for a line; ended by the test's time limit if it does not come."""
    while line not in lines:
        Event().wait(0.01)


def test_a_log_shows_how_far_unfinished_tasks_are(lines: list[str]) -> None:
    with bars("three things") as bar:
        bar.update(bar.add_task("done", total=2), completed=2)
        bar.update(bar.add_task("things [bold]", total=3), completed=2)
        bar.add_task("comparing", total=None)
        bar.update(bar.add_task("steps", total=1.0), completed=0.247)
        tracked = iter(bar.track(["first", "second"], description="tracked"))
        assert [next(tracked), next(tracked)] == ["first", "second"]
        assert lines[0] == "three things"
        wait_for(
            "things [bold]: 2 of 3; comparing; steps: 25 %; tracked: 1 of 2", lines
        )


def test_a_log_repeats_no_line_while_nothing_moves(lines: list[str]) -> None:
    with bars("two robots") as bar:
        task = bar.add_task("rendering", total=2)
        wait_for("rendering: 0 of 2", lines)
        Event().wait(0.2)  # of many lines, if they were repeated
        bar.update(task, completed=1)
        wait_for("rendering: 1 of 2", lines)
    assert lines == ["two robots", "rendering: 0 of 2", "rendering: 1 of 2"]
