"""Import path of child processes.

``python -m`` and ``python -c``, which starts spawned processes, search the current
folder first. A file ``random.py`` of the user there would replace the module of the
standard library, so children search where their parent does.
"""

import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

_FLAG = "PYTHONSAFEPATH"


def python_command(module: str) -> list[str]:
    """Return the start of a command that runs a module in a process of its own."""
    return [sys.executable, "-P", "-m", module]


def environment() -> dict[str, str]:
    """Return the environment of children, which import what this process can."""
    paths = [str(Path(path).absolute()) for path in sys.path]
    return {**os.environ, "PYTHONPATH": os.pathsep.join(dict.fromkeys(paths))}


@contextmanager
def safe_import_path() -> Iterator[None]:
    """Let processes spawned in the block not import from the current folder."""
    before = os.environ.get(_FLAG)
    os.environ[_FLAG] = "1"
    try:
        yield
    finally:
        if before is None:
            del os.environ[_FLAG]
        else:
            os.environ[_FLAG] = before
