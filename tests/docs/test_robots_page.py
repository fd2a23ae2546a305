"""The examples of docs/robots.md run as they stand, and its message is true."""

import re
from pathlib import Path

import pytest

from schema.errors import InvalidRobot
from schema.formats.files import read_robot

PAGE = (Path(__file__).parents[2] / "docs" / "robots.md").read_text()


def block(language: str) -> str:
    """Return the only block of a language on the page."""
    (found,) = re.findall(
        rf"^```{language}\n(.*?)^```$", PAGE, re.DOTALL | re.MULTILINE
    )
    return str(found)


def test_the_example_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("walker.yaml").write_text(block("yaml"))
    exec(compile(block("python"), "robots.md", "exec"), {})  # noqa: S102
    assert float(capsys.readouterr().out) > 0.0
    assert Path("walker.urdf").read_text().startswith("<?xml")


def test_the_message_is_the_one_of_the_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    wrong = block("yaml").replace("{1: {id: leg", "{0: {id: leg")
    Path("walker.yaml").write_text(wrong)
    with pytest.raises(InvalidRobot) as error:
        read_robot(Path("walker.yaml"))
    (quoted,) = re.findall(r"^    (walker\.yaml:.*)$", PAGE, re.MULTILINE)
    assert str(error.value) == quoted
