"""Texts of other processes that are shown to the user."""

import pytest

from schema.limits import printable


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
