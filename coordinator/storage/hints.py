"""Commands that messages suggest to the user."""

import shlex
from collections.abc import Sequence
from pathlib import Path

from coordinator.storage.disk import replace_text
from schema.errors import RunFolderError
from schema.limits import printable_line
from schema.tables.description import read_small

FLAGS = ".resume_flags"
"""File of a run or campaign folder: flags with which it has the same agents again."""
_LONGEST = 4096


def command(*words: object) -> str:
    """Return a ``revolve`` command, quoted for a shell."""
    return shlex.join(["revolve", *map(str, words)])


def stopped(folder: Path, flags: Sequence[str] = ()) -> str:
    """Return the message that a run or campaign was stopped, and how to resume it."""
    return f"stopped; to resume: {command('resume', folder, *flags)}"


def keep_flags(folder: Path, flags: Sequence[str]) -> None:
    """Keep the flags of ``stopped`` for ``resume_command``, a word in each line."""
    replace_text(folder / FLAGS, "".join(f"{word}\n" for word in flags))


def resume_command(folder: Path, *flags: str) -> str:
    """Return the command that resumes a run or campaign with the same agents.

    Runs of earlier versions have kept no flags; ``flags`` are further ones.
    """
    try:
        words = read_small(folder / FLAGS, _LONGEST).decode().splitlines()
    except (FileNotFoundError, RunFolderError, UnicodeDecodeError):
        words = []
    return command("resume", folder, *map(printable_line, words), *flags)
