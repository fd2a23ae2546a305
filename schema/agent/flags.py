"""Command line flags: errors in one line, numbers within their limits.

Each reader of a number raises ``argparse.ArgumentTypeError`` for any other text. The
parser turns it into one line: the flag, what is allowed, what was given.
"""

import argparse
import math
from collections.abc import Callable, Sequence
from typing import Any, NoReturn

from schema.errors import nearest
from schema.limits import MOST_NUMBER, MOST_SEED

# Those of 2^64; the interpreter reads no number of more than 4300.
_MOST_DIGITS = 20


class Flags(argparse.ArgumentParser):
    """Parser that reports an error in one line and ends its help with examples.

    Flags cannot be abbreviated: a new flag would change what an abbreviation means.

    Its examples are complete command lines; text after ``#`` is a comment.
    """

    last_error = ""

    def __init__(
        self,
        *,
        examples: Sequence[str] = (),
        **settings: Any,  # noqa: ANN401 - passed on
    ) -> None:
        super().__init__(**settings, allow_abbrev=False)
        self.examples = tuple(examples)

    def error(self, message: str) -> NoReturn:
        """Print the error and where to find help; exit with status 2."""
        message = message.replace("ignored explicit argument", "takes no value, got")
        Flags.last_error = f"{self.prog}: {message} (see {self.prog} --help)"
        self.exit(2, f"{self.last_error}\n")

    def _check_value(self, action: argparse.Action, value: object) -> None:
        """Raise unless a value is one of its flag's choices; name the nearest."""
        if action.choices is not None and value not in action.choices:
            names = list(map(str, action.choices))
            rule = f"must be one of {', '.join(names)}, got {str(value)[:80]!r}"
            raise argparse.ArgumentError(action, rule + nearest(value, names))

    def format_help(self) -> str:
        """Return the help, with the examples at the end."""
        lines = "".join(f"  {example}\n" for example in self.examples)
        return super().format_help() + (f"\nexamples:\n{lines}" if lines else "")

    def parse_known_args(  # type: ignore[override]
        self,
        args: Sequence[str] | None = None,
        namespace: Any = None,  # noqa: ANN401
    ) -> tuple[Any, list[str]]:
        """Parse arguments; exit with an error that names the first unknown one."""
        options, unknown = super().parse_known_args(args, namespace)
        if unknown:
            word = unknown[0].partition("=")[0]
            if not word.startswith("-"):
                self.error(f"unexpected argument {word[:80]!r}")
            # Dashes, which all flags share, would make any two of them similar.
            known = [flag.lstrip("-") for flag in self._option_string_actions]
            near = nearest(word.lstrip("-"), known).replace(" '", " '--")
            self.error(f"no flag {word[:80]!r}{near}")
        return options, []


def whole_number(least: int = 1, most: int | None = None) -> Callable[[str], int]:
    """Return a reader of whole numbers from ``least`` >= 0; None is no limit."""
    limits = f">= {least}" if most is None else f"in {least}..{most}"

    def read(text: str) -> int:
        is_number = text.isascii() and text.isdigit() and len(text) <= _MOST_DIGITS
        is_allowed = is_number and int(text) >= least
        if not is_allowed or (most is not None and int(text) > most):
            raise argparse.ArgumentTypeError(
                f"must be a whole number {limits}, got {text[:80]!r}"
            )
        return int(text)

    return read


def add_seed(flags: argparse.ArgumentParser, default: int) -> None:
    """Add the flag for a seed of evolution, which has 64 bits."""
    add_count(flags, "--seed", default, "random seed", least=0, most=MOST_SEED)


def birth_name(text: str) -> tuple[int | None, int]:
    """Return island and number of a birth; the island is None if it is not given."""
    island, colon, number = text.rpartition(":")
    read = whole_number(0, MOST_NUMBER)
    try:
        return read(island) if colon else None, read(number)
    except argparse.ArgumentTypeError:
        raise argparse.ArgumentTypeError(
            f"must be N or ISLAND:N in whole numbers >= 0, got {text[:80]!r}"
        ) from None


def add_count(
    flags: argparse.ArgumentParser,
    name: str,
    default: int | None,
    what: str,
    least: int = 1,
    *,
    most: int | None = None,
) -> None:
    """Add a flag for a whole number from ``least`` on; ``what`` explains None."""
    flags.add_argument(
        name,
        type=whole_number(least, most),
        default=default,
        metavar="N",
        help=what if default is None else f"{what} (default: %(default)s)",
    )


def add_plugins(flags: argparse.ArgumentParser) -> None:
    """Add the flag for modules that may be imported (``permission.allow``)."""
    flags.add_argument(
        "--plugins",
        action="append",
        default=[],
        metavar="MODULE|FILE|NAME=PATH",
        help="allow a module, a .py or .robot file, or a module from a file or folder, "
        "with plug-ins; may be repeated (default: built-in modules, installed entry "
        "points 'revolve.plugins', and modules of a .toml file, if one is given)",
    )


def add_settings(flags: argparse.ArgumentParser, default: str) -> None:
    """Add the flags for the settings of a robot file; ``default`` describes them."""
    flags.add_argument(
        "--experiment",
        metavar="NAME|FILE.toml",
        help=f"experiment whose settings to use (default: {default})",
    )
    add_count(
        flags,
        "--island",
        None,
        "island number, for experiments whose islands differ (default: for best.yaml "
        "of a run the island on which it has its fitness, else 0)",
        least=0,
    )


def number(text: str) -> float:
    """Return a flag's value as a finite number."""
    return _number(text, "a finite number", lambda _value: True)


def positive_number(text: str) -> float:
    """Return a flag's value as a finite number > 0."""
    return _number(text, "a finite number > 0", lambda value: value > 0.0)


def share(text: str) -> float:
    """Return a flag's value as a number from 0 to 1."""
    return _number(text, "a number from 0 to 1", lambda value: 0.0 <= value <= 1.0)


def _number(text: str, what: str, is_allowed: Callable[[float], bool]) -> float:
    try:
        value = float(text)
    except ValueError:
        value = math.nan
    if not (math.isfinite(value) and is_allowed(value)):
        raise argparse.ArgumentTypeError(f"must be {what}, got {text!r}")
    return value
