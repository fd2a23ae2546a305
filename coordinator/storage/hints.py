"""Commands that messages suggest to the user."""

import shlex
from pathlib import Path


def command(*words: object) -> str:
    """Return a ``revolve`` command, quoted for a shell."""
    return shlex.join(["revolve", *map(str, words)])


def stopped(folder: Path) -> str:
    """Return the message after a run or campaign was stopped."""
    return f"stopped; to resume: {command('resume', folder)}"
