"""Lines for the user on standard error: plain, with time and level, or as JSON.

A command that runs for long calls ``start_log``: its lines then have time and level
unless standard error is a terminal. Lines of other commands are plain. Processes that
it starts inherit the form by an environment variable.
"""

import json
import logging
import os
import sys
from datetime import UTC, datetime

from schema.errors import RevolveError
from schema.limits import printable_lines

LOG_VARIABLE = "REVOLVE_LOG"
"""Environment variable with the form of the lines; "json" does what the flag does."""
_PLAIN, _TIMED, _JSON = _FORMS = ("plain", "time", "json")
_LOGGER = "revolve"


class _Handler(logging.Handler):
    """Writes records to what is standard error at the time."""

    def __init__(self) -> None:
        super().__init__()
        self.form = _PLAIN
        self.process = _LOGGER

    def emit(self, record: logging.LogRecord) -> None:
        """Write a record as one line, more if its message has more.

        No text can move a terminal's cursor: control characters become ``?``.
        """
        sys.stderr.write(f"{self._line(record)}\n")
        sys.stderr.flush()

    def _line(self, record: logging.LogRecord) -> str:
        message = printable_lines(record.getMessage())
        if self.form == _PLAIN:
            return message
        level = record.levelname.lower()
        moment = datetime.fromtimestamp(record.created, UTC)
        if self.form == _TIMED:
            local = moment.astimezone()
            return f"{local:%Y-%m-%d %H:%M:%S} {level}: {message}"
        entry = {
            "time": moment.isoformat(timespec="milliseconds"),
            "level": level,
            "process": self.process,
            "pid": record.process,
            "message": message,
        }
        return json.dumps(entry, ensure_ascii=False)


def tell_user(line: str) -> None:
    """Write a line about the normal course of things."""
    _logger().info("%s", line)


def warn_user(line: str) -> None:
    """Write a line about something that may need the user."""
    _logger().warning("%s", line)


def tell_error(line: str) -> None:
    """Write a line about what ends a run or this process."""
    _logger().error("%s", line)


def start_log(process: str, *, as_json: bool = False) -> None:
    """Give the lines of this process, and of those that it starts, time and level.

    Unless it is JSON, the environment decides on the form, or else whether standard
    error is a terminal.

    Raises:
        RevolveError: the environment names an unknown form.
    """
    handler = _handler()
    form = _JSON if as_json else os.environ.get(LOG_VARIABLE, "")
    if form not in ("", *_FORMS):
        raise RevolveError(
            f"${LOG_VARIABLE}: must be {', '.join(_FORMS)}, got {form[:80]!r}"
        )
    handler.form = form or (_PLAIN if _is_terminal() else _TIMED)
    handler.process = process
    os.environ[LOG_VARIABLE] = handler.form


def log_form() -> str:
    """Return the form of this process's lines: "plain", "time" or "json"."""
    return _handler().form


def _is_terminal() -> bool:
    # Not by sys.stderr: progress bars replace it.
    try:
        return os.isatty(2)
    except OSError:
        return False


def _logger() -> logging.Logger:
    _handler()
    return logging.getLogger(_LOGGER)


def _handler() -> _Handler:
    """Return the handler of this process; made with the first line."""
    logger = logging.getLogger(_LOGGER)
    for handler in logger.handlers:
        if isinstance(handler, _Handler):
            return handler
    made = _Handler()
    logger.addHandler(made)
    logger.setLevel(logging.INFO)
    logger.propagate = False
    return made
