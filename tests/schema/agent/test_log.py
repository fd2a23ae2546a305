"""Lines of a log, and the progress of one task."""

import io
import json
import os
import re
import time
from datetime import UTC, datetime, timedelta

import pytest
from rich.console import Console

from schema.agent.log import (
    LOG_VARIABLE,
    log_form,
    start_log,
    tell_error,
    tell_user,
    warn_user,
)
from schema.agent.progress_line import SPAN_S, ProgressLine, progress_if_long
from schema.errors import RevolveError


def terminal(monkeypatch: pytest.MonkeyPatch, *, is_there: bool) -> None:
    monkeypatch.setattr(os, "isatty", lambda _number: is_there)


def write_all() -> None:
    tell_user("it begins")
    warn_user("it is slow")
    tell_error("it ends")


def test_lines_are_plain_without_a_start_and_at_a_terminal(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    plain = "it begins\nit is slow\nit ends\n"
    write_all()
    assert capsys.readouterr().err == plain
    terminal(monkeypatch, is_there=True)
    start_log("coordinator")
    write_all()
    assert capsys.readouterr().err == plain


def test_lines_in_a_file_have_time_and_level(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    terminal(monkeypatch, is_there=False)
    start_log("coordinator")
    write_all()
    lines = capsys.readouterr().err.splitlines()
    time = r"\d{4}-\d\d-\d\d \d\d:\d\d:\d\d"
    assert re.fullmatch(rf"{time} info: it begins", lines[0])
    assert re.fullmatch(rf"{time} warning: it is slow", lines[1])
    assert re.fullmatch(rf"{time} error: it ends", lines[2])


@pytest.mark.parametrize("is_there", [True, False])
def test_json_has_one_object_per_line(
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    *,
    is_there: bool,
) -> None:
    terminal(monkeypatch, is_there=is_there)
    start_log("coordinator", as_json=True)
    warn_user('two\nlines of "ü"')
    (line,) = capsys.readouterr().err.splitlines()
    entry = json.loads(line)
    age = datetime.now(UTC) - datetime.fromisoformat(entry.pop("time"))
    assert timedelta(-1) < age < timedelta(minutes=5)
    assert entry == {
        "level": "warning",
        "process": "coordinator",
        "pid": os.getpid(),
        "message": 'two\nlines of "ü"',
    }


def test_processes_that_are_started_inherit_the_form(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    terminal(monkeypatch, is_there=True)
    start_log("coordinator")
    assert os.environ[LOG_VARIABLE] == "plain"
    terminal(monkeypatch, is_there=False)
    start_log("own-worker-0")
    assert log_form() == "plain"
    monkeypatch.setenv(LOG_VARIABLE, "json")
    start_log("own-worker-0")
    assert log_form() == "json"


def test_an_unknown_form_is_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(LOG_VARIABLE, "xml")
    with pytest.raises(RevolveError, match=r"\$REVOLVE_LOG: must be plain, time, json"):
        start_log("worker")


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
    monkeypatch.setattr("schema.agent.progress_line.SOON_S", 0.05)
    with progress_if_long("0 of 9") as tell:
        tell("1 of 9")
        time.sleep(0.5)
        tell("2 of 9")
    assert capsys.readouterr() == ("", "1 of 9\n")
