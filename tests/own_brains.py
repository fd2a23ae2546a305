"""The module of docs/brains.md, as an experiment's own plug-in."""

import re
from pathlib import Path

PAGE = Path(__file__).parents[1] / "docs" / "brains.md"


def blocks(language: str) -> list[str]:
    """Return the blocks of code of the page in a language."""
    return re.findall(
        rf"^```{language}\n(.*?)^```", PAGE.read_text(), re.MULTILINE | re.DOTALL
    )


def write_module(folder: Path) -> Path:
    """Write the page's module into a folder and return its file."""
    file = folder / "my_brains.py"
    file.write_text("\n\n".join(blocks("python")))
    return file
