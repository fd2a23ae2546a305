"""Result of one check."""

from dataclasses import dataclass
from typing import Literal

Level = Literal["ok", "warn", "fail"]


@dataclass(frozen=True, slots=True)
class Finding:
    """What a check found.

    Attributes:
        level: "ok"; "warn": something works worse or not at all that a run does not
            need; "fail": runs do not work.
        subject: what was checked.
        text: what was found.
        advice: what to do; empty if nothing is.
    """

    level: Level
    subject: str
    text: str
    advice: str = ""

    def __str__(self) -> str:
        """Return the finding as one line."""
        line = f"{self.level:4}  {self.subject:12}  {self.text}"
        return f"{line}; {self.advice}" if self.advice else line


Case = tuple[bool, Level, str, str]
"""Whether a case holds; level, text and advice of its finding."""


def judged(subject: str, text: str, *cases: Case) -> Finding:
    """Return the finding of the first case that holds, else "ok" with the text."""
    for holds, level, what, advice in cases:
        if holds:
            return Finding(level, subject, what, advice)
    return Finding("ok", subject, text)
