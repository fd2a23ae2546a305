"""Write the pages that are generated from the code: docs/reference.md and reference/.

python -m docs.reference_pages
"""

from collections.abc import Callable
from pathlib import Path

from docs import (
    columns_reference,
    commands_reference,
    messages_reference,
    settings_reference,
)
from docs.python_reference import reference

_HERE = Path(__file__).parent
PAGES: dict[Path, Callable[[], str]] = {
    _HERE / "reference.md": reference,
    _HERE / "reference" / "settings.md": settings_reference.page,
    _HERE / "reference" / "columns.md": columns_reference.page,
    _HERE / "reference" / "commands.md": commands_reference.page,
    _HERE / "reference" / "messages.md": messages_reference.page,
}
"""The text of each page."""


if __name__ == "__main__":
    for file, page in PAGES.items():
        file.parent.mkdir(exist_ok=True)
        file.write_text(page(), "utf-8")
