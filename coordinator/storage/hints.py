"""Commands that messages suggest to the user."""

import shlex
from pathlib import Path


def command(*words: object) -> str:
    """Return a command of ours, as it can be pasted into a shell."""
    return shlex.join(["revolve", *map(str, words)])


def stopped(folder: Path) -> str:
    """Return what is said of a run or campaign that was stopped."""
    return f"stopped; to go on: {command('resume', folder)}"
