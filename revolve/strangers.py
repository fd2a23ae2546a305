"""Check that the modules of this project are those of this project.

Their names are common words. Another distribution of the same environment may have a
module of the same name, or overwrite a file of ours: PyPI's ``schema`` does.
"""

import ast
from functools import lru_cache
from importlib.util import find_spec
from pathlib import Path

ROOMS = ("schema", "coordinator", "worker", "analyzer", "analysis")
_OURS = Path(__file__).resolve().parent.parent


@lru_cache(maxsize=1)
def stranger() -> str:
    """Return a line about a module that is not this project's; empty if all are.

    Nothing is imported. The file ``__init__.py`` of a room holds a docstring only.
    """
    for room in ROOMS:
        wanted = _OURS / room / "__init__.py"
        try:
            spec = find_spec(room)
        except ValueError:  # a module that was made by hand
            spec = None
        origin = spec.origin if spec is not None else None
        if origin is None or Path(origin).resolve() != wanted or not _is_ours(wanted):
            what = f"the module {room!r} is not that of Revolve Islands but"
            if origin is not None and not _is_installed(Path(origin)):
                return f"{what} {origin}: rename yours"
            return (
                f"{what} of another package ({origin or 'of unknown place'}): install "
                "revolve-islands again, in an environment of its own"
            )
    return ""


def _is_installed(file: Path) -> bool:
    """Return whether a file belongs to an installed package or to this project."""
    ours = Path(__file__).absolute().parent.parent
    return file.is_relative_to(ours) or any(
        part in ("site-packages", "dist-packages") for part in file.parts
    )


def _is_ours(init: Path) -> bool:
    """Return whether a file holds a docstring and nothing else."""
    try:
        tree = ast.parse(init.read_bytes())
    except (OSError, SyntaxError, ValueError):
        return False
    return len(tree.body) == 1 and ast.get_docstring(tree) is not None
