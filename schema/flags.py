"""Flags of commands: complaints in one line, numbers within their limits.

What reads a number raises ``argparse.ArgumentTypeError`` where the text is none, which
the parser turns into one line: the flag, what is allowed, what came.
"""

import argparse
import math
from collections.abc import Callable
from typing import NoReturn


class Flags(argparse.ArgumentParser):
    """A parser whose complaints are one line (argparse is made for this override)."""

    def error(self, message: str) -> NoReturn:
        """Say what is wrong and where help is; end with status 2."""
        self.exit(2, f"{self.prog}: {message} (see {self.prog} --help)\n")


def whole_number(least: int = 1) -> Callable[[str], int]:
    """Return what reads a whole number of a flag.

    Args:
        least: that is allowed; not negative.
    """

    def read(text: str) -> int:
        if not (text.isascii() and text.isdigit() and int(text) >= least):
            raise argparse.ArgumentTypeError(
                f"must be a whole number >= {least}, got {text!r}"
            )
        return int(text)

    return read


def add_count(
    flags: argparse.ArgumentParser, name: str, default: int, what: str, least: int = 1
) -> None:
    """Add a flag for a whole number.

    Args:
        flags: to add it to.
        name: of the flag.
        default: its value if it is not given.
        what: it is the number of, for the help.
        least: that is allowed; not negative.
    """
    flags.add_argument(
        name,
        type=whole_number(least),
        default=default,
        metavar="N",
        help=f"{what} (default: %(default)s)",
    )


def number(text: str) -> float:
    """Return a flag's value as a finite number."""
    return _number(text, "a finite number", -math.inf, math.inf)


def positive_number(text: str) -> float:
    """Return a flag's value as a finite number > 0."""
    value = _number(text, "a finite number > 0", 0.0, math.inf)
    if value == 0.0:
        raise argparse.ArgumentTypeError(f"must be a finite number > 0, got {text!r}")
    return value


def share(text: str) -> float:
    """Return a flag's value as a number from 0 to 1."""
    return _number(text, "a number from 0 to 1", 0.0, 1.0)


def _number(text: str, what: str, least: float, most: float) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and least <= value <= most):
        raise argparse.ArgumentTypeError(f"must be {what}, got {text!r}")
    return value
