"""docs/reference.md agrees with the docstrings."""

import revolve
from docs.python_reference import PAGE, reference


def test_page_is_up_to_date() -> None:
    assert PAGE.read_text("utf-8") == reference(), "run python -m docs.python_reference"


def test_every_public_name_has_an_entry() -> None:
    titles = [line for line in reference().splitlines() if line.startswith("## ")]
    assert sorted(titles) == sorted(f"## `{name}`" for name in revolve.__all__)
