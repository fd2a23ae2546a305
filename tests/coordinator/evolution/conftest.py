"""Own encodings for tests: the class of docs/encodings.md, with changes."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from schema.experiment.document import EncodingSection, Experiment
from schema.plugins import permission

PAGE = Path(__file__).parents[3] / "docs" / "encodings.md"

Own = Callable[..., Experiment]
"""Function of replacements in the class's text; see ``own_encoding``."""


@pytest.fixture
def own_encoding(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Own:
    """Return a function that makes an experiment with an own encoding.

    Its arguments are pairs of a text in the module of the page and its replacement,
    and as keywords the parameters of the encoding.
    """
    monkeypatch.setattr(permission, "_allowed", {})
    pattern = re.compile(r"^```python\n(.*?)^```", re.MULTILINE | re.DOTALL)
    (found,) = pattern.findall(PAGE.read_text())
    made: list[str] = []

    def experiment(*changes: tuple[str, str], **parameters: float) -> Experiment:
        text: str = found
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        name = f"{tmp_path.name}_{len(made)}"
        made.append(name)
        (tmp_path / f"{name}.py").write_text(text)
        permission.allow([str(tmp_path / f"{name}.py")])
        section = EncodingSection(type=f"{name}:Worms", parameters=parameters)
        return Experiment(name="test", encoding=section)

    return experiment
