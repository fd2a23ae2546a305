"""Exceptions that one part of Revolve reports to another.

The class of an exception names the source of the fault, which decides its handling.
"""

import re
from collections.abc import Iterator
from contextlib import contextmanager
from difflib import get_close_matches
from itertools import islice
from pathlib import Path
from typing import Any, Literal

from schema.limits import LONGEST_REASON, MOST_SHOWN, printable

_MOST_NAMES = 1000
"""Names in a folder among which the nearest is searched."""
NO_MESSAGE = "(no message)"
"""Text of an error without one: an empty reason would mean that nothing failed."""


class RevolveError(Exception):
    """Base of all errors, which commands print as one line."""

    def __str__(self) -> str:
        """Return the message, which is never empty."""
        return super().__str__().strip() or NO_MESSAGE


@contextmanager
def naming(where: object, kind: type[RevolveError] = RevolveError) -> Iterator[None]:
    """Begin the message of an error of a kind with the place where it occurs."""
    try:
        yield
    except kind as error:
        raise type(error)(f"{where}: {error}") from error


class ExperimentError(RevolveError):
    """Invalid experiment; the message says where, what was given, what is allowed."""


class UnknownPlugin(ExperimentError):  # noqa: N818 - reads as what it says
    """A ``module:attribute`` or a name that does not exist."""


class PluginDiffers(RevolveError):  # noqa: N818 - reads as what it says
    """A plug-in of the run is missing on a machine, or its source differs."""


class InvalidRobot(RevolveError):  # noqa: N818 - reads as what it says
    """A robot or genome that breaks the rules of its body space."""


class RunFolderError(RevolveError):
    """A run folder that is in use, damaged, missing or already taken."""


class NetworkError(RevolveError):
    """An address that cannot be listened on or reached."""


def check_most(
    count: int, most: int, what: str, where: str, kind: type[RevolveError]
) -> None:
    """Raise an error of a kind if there are more things than a limit allows."""
    if count > most:
        raise kind(f"{where}: must have <= {most} {what}, got {count}")


_TYPES = {
    "int": "a whole number",
    "float": "a number",
    "str": "a text",
    "bool": "true or false",
    "array": "a list",
    "object": "a table",
}
"""Names that msgspec gives to types, in words."""

MessageFault = Literal["malformed", "too large", "stale", "impossible", "differs"]
"""What is wrong with a message, for counts.

- ``malformed``: it does not decode, or breaks a rule of its own type.
- ``too large``: it exceeds a limit of ``schema.limits``, or one of its request.
- ``stale``: it belongs to another request.
- ``impossible``: it contradicts its request or the state of the run.
- ``differs``: it repeats a past result with another outcome, as a machine that
  computes differently does; like an error, this can stop a run.
"""


class MalformedMessage(RevolveError):  # noqa: N818 - reads as what it says
    """A message of a peer that is not believed: it is counted by kind, and dropped."""

    def __init__(self, why: str, kind: MessageFault = "malformed") -> None:
        """Initialise with a reason, which may quote the peer and is cut."""
        super().__init__(printable(why, LONGEST_REASON))
        self.kind: MessageFault = kind


class UnexpectedEvent(RevolveError):  # noqa: N818 - reads as what it says
    """An event that the state does not allow: a bug, so the run stops."""


class FitnessUndefined(RevolveError):  # noqa: N818 - reads as what it says
    """The fitness function raised or returned no finite number: a failed result."""


class JobRefused(RevolveError):  # noqa: N818 - reads as what it says
    """Several agents cannot do a job: a fault of machines, not a result."""


class RunPaused(RevolveError):  # noqa: N818 - reads as what it says
    """A run stops and waits for its user; ``revolve resume`` continues it."""


class SensorFailed(RevolveError):  # noqa: N818 - reads as what it says
    """A sensor of a plug-in raised or gave wrong values: a failed result."""


class SimulationDiverged(RevolveError):  # noqa: N818 - reads as what it says
    """The simulation diverged: a failed result."""


class StateDiffers(RevolveError):  # noqa: N818 - reads as what it says
    """A rebuilt arena has another state: this machine computes differently."""


def one_line(error: BaseException) -> str:
    """Return the message of an error as one line that can be printed.

    The error may be that of a plug-in: any text, or none because it raises itself.
    """
    try:
        text = str(error)
    except Exception as fault:  # noqa: BLE001 - of the code of a user
        return f"(no message: its __str__ raises {type(fault).__name__})"
    return printable(text, len(text)) or NO_MESSAGE


def error_text(error: BaseException) -> str:
    """Return the type and the message of any error as one line, cut if it is long."""
    return f"{type(error).__name__}: {printable(one_line(error), LONGEST_REASON)}"


def shown(value: object) -> str:
    """Return a value for a message: as in Python, cut if it is long."""
    try:
        text = repr(value)
    except Exception:  # noqa: BLE001 - a value of a plug-in may raise anything
        # Python writes no integer of more than 4300 digits, for example.
        return f"a {type(value).__name__} that cannot be shown"
    return cut(text)


def cut(text: str) -> str:
    """Return a text for a message, cut if it is long."""
    return text if len(text) <= MOST_SHOWN else f"{text[:MOST_SHOWN]}..."


def unreadable(error: OSError | UnicodeDecodeError, near: str = "") -> str:
    """Return why a file cannot be read, as the end of a message.

    Of a missing file it ends with ``near``, or with the file of the nearest name.
    """
    if isinstance(error, UnicodeDecodeError):
        return f"cannot be read: not UTF-8 at byte {error.start}"
    if not isinstance(error, FileNotFoundError):
        near = ""
    elif not near and error.filename:
        near = near_files(Path(error.filename))
    return f"cannot be read: {error.strerror or error}{near}"


def near_files(missing: Path, pattern: str = "*") -> str:
    """Return ``; did you mean 'x'?`` for a path of similar name beside a missing one.

    ``pattern`` is that of ``Path.glob``: "*/" are folders.
    """
    names = (each.name for each in missing.parent.glob(pattern))
    found = get_close_matches(missing.name[:MOST_SHOWN], islice(names, _MOST_NAMES), 1)
    return f"; did you mean {str(missing.with_name(found[0]))!r}?" if found else ""


def expectation(message: str) -> str:
    """Return a message of msgspec in words, such as "must be a number, got a text"."""
    text = message.replace("Expected ", "must be ")
    text = re.sub(r" [<>]= -?1\.7976931348623157e\+308", " that is finite", text)
    text = re.sub(
        "Object missing required field `(.*?)`", r"must have a key '\1'", text
    )
    return re.sub(r"`(\w+(?: \| \w+)*)`", _types_in_words, text)


def _types_in_words(found: re.Match[str]) -> str:
    """Return the types of a message in words; TOML has no null."""
    kinds = [kind for kind in found[1].split(" | ") if kind != "null"]
    if not all(kind in _TYPES for kind in kinds):
        return found[0]
    return " or ".join(_TYPES[kind] for kind in kinds)


FAILURES = (SimulationDiverged, SensorFailed, FitnessUndefined)
"""Errors of a robot, with which its evaluation is a failed result."""


def counted(number: int, noun: str) -> str:
    """Return a number and a noun, whose plural ends in "s", such as "2 workers"."""
    return f"{number} {noun}{'' if number == 1 else 's'}"


def rounded(value: float, digits: int = 4) -> str:
    """Return a number with so many significant digits, also if it is small.

    Whole numbers keep all of their digits; there is no exponent from 1 / 10000 on.
    """
    if abs(value) >= 10**digits - 0.5:
        return f"{value:.0f}"
    return f"{value:#.{digits}g}".rstrip(".")


def nearest(word: Any, words: Any) -> str:  # noqa: ANN401 - any iterable of str
    """Return ``; did you mean 'x'?`` for the nearest word, or an empty text."""
    # The search takes quadratic time.
    found = get_close_matches(str(word)[:MOST_SHOWN], list(words), n=1, cutoff=0.5)
    return f"; did you mean {found[0]!r}?" if found else ""
