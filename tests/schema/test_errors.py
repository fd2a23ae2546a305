"""Texts of errors and of other processes, as users see them."""

import pytest

from schema.errors import (
    InvalidRobot,
    RevolveError,
    error_text,
    one_line,
    rounded,
    shown,
)
from schema.limits import LONGEST_REASON, printable


@pytest.mark.parametrize(
    ("value", "expected"),
    [
        (0.00023456, "0.0002346"),
        (0.1, "0.1000"),
        (-0.00102, "-0.001020"),
        (1.02e-7, "1.020e-07"),
        (0.0, "0.000"),
        (12.3456, "12.35"),
        (1234.4, "1234"),
        (9999.6, "10000"),
        (123456.7, "123457"),
    ],
)
def test_numbers_keep_four_significant_digits(value: float, expected: str) -> None:
    assert rounded(value) == expected


def test_number_of_digits_may_be_chosen() -> None:
    assert rounded(0.51234, 3) == "0.512"


class Mute(Exception):  # noqa: N818 - reads as what it says
    """Error of a plug-in that cannot be shown."""

    def __str__(self) -> str:
        raise KeyError("code")

    __repr__ = __str__


@pytest.mark.parametrize(
    ("error", "expected"),
    [
        (ValueError("two\n  lines"), "two lines"),
        (ValueError("\x1b[31m red \ud800 ü"), "?[31m red ? ü"),
        (ValueError("x" * 2000), "x" * 2000),
        (ValueError(), "(no message)"),
        (ValueError(" \n"), "(no message)"),
        (RevolveError(), "(no message)"),
        (Mute(), "(no message: its __str__ raises KeyError)"),
    ],
)
def test_any_error_is_one_line_that_can_be_printed(
    error: Exception, expected: str
) -> None:
    assert one_line(error) == expected


def test_an_error_of_ours_is_never_empty() -> None:
    """A plug-in may raise one without message; an empty reason is no failure."""
    for error in (RevolveError(), InvalidRobot(""), InvalidRobot("  ")):
        assert str(error) == "(no message)"
    assert str(InvalidRobot("slot 3")) == "slot 3"
    assert error_text(KeyError()) == "KeyError: (no message)"


def test_the_text_of_a_foreign_error_is_cut() -> None:
    text = error_text(ValueError("x" * 1_000_000))
    assert len(text) == len("ValueError: ") + LONGEST_REASON
    assert error_text(Mute()).startswith("Mute: (no message")


def test_a_value_that_cannot_be_shown_is_named_by_its_type() -> None:
    assert shown(Mute()) == "a Mute that cannot be shown"
    assert shown(10**5000) == "a int that cannot be shown"


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ("", ""),
        ("plain", "plain"),
        (" two\r\n lines\t", "two lines"),
        ("\x1b[31mred\x1b[0m", "?[31mred?[0m"),
        ("left\u202eright\0", "left?right?"),
        ("Grüße 机器人", "Grüße 机器人"),
        ("x" * 11, "xxxxxxx..."),
        (" " * 1000 + "x", "..."),
    ],
)
def test_texts_become_short_printable_lines(text: str, line: str) -> None:
    assert printable(text, 10 if len(text) > 10 and "x" in text else 40) == line
