"""Commands that messages suggest to the user."""

import shlex
from collections.abc import Sequence
from pathlib import Path


def command(*words: object) -> str:
    """Return a ``revolve`` command, quoted for a shell."""
    return shlex.join(["revolve", *map(str, words)])


def stopped(folder: Path, flags: Sequence[str] = ()) -> str:
    """Return the message after a run or campaign was stopped.

    Args:
        folder: of the run or campaign.
        flags: with which ``revolve resume`` has the same agents again.
    """
    return f"stopped; to resume: {command('resume', folder, *flags)}"
