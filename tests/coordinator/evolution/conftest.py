"""Own encodings for tests: the class of docs/encodings.md, with changes."""

from collections.abc import Callable
from pathlib import Path

import pytest

from schema.experiment.document import EncodingSection, Experiment
from tests.docs.page_runner import blocks_of

PAGE = Path(__file__).parents[3] / "docs" / "encodings.md"

Own = Callable[..., Experiment]
"""Function of replacements in the class's text; see ``own_encoding``."""


@pytest.fixture
def own_encoding(own_module: Callable[[str], str]) -> Own:
    """Return a function that makes an experiment with an own encoding.

    Its arguments are pairs of a text in the module of the page and its replacement,
    and as keywords the parameters of the encoding.
    """
    (page,) = blocks_of(PAGE, "python")

    def experiment(*changes: tuple[str, str], **parameters: float) -> Experiment:
        text = page
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        section = EncodingSection(
            type=f"{own_module(text)}:Worms", parameters=parameters
        )
        return Experiment(name="test", encoding=section)

    return experiment
