"""The examples of docs/robots.md run as they stand, and its message is true."""

import math
import re
from pathlib import Path
from typing import Any

import pytest

from schema.errors import InvalidRobot
from schema.formats.files import read_robot
from tests.docs.page_runner import blocks_of

PAGE = Path(__file__).parents[2] / "docs" / "robots.md"


def block(language: str, number: int = 0) -> str:
    """Return a block of a language on the page."""
    return blocks_of(PAGE, language)[number]


def test_the_example_runs(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("walker.yaml").write_text(block("yaml"))
    exec(compile(block("python"), "robots.md", "exec"), {})  # noqa: S102
    assert float(capsys.readouterr().out) > 0.0
    assert Path("walker.urdf").read_text().startswith("<?xml")


def test_plain_mujoco_moves_a_motor_as_the_page_says(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """0.8 of the range from -45 to 45 degrees is 27 degrees, at a gain of 0.9 / s."""
    monkeypatch.chdir(tmp_path)
    Path("walker.yaml").write_text(block("yaml"))
    names: dict[str, Any] = {}
    exec(compile(block("python", 1), "robots.md", "exec"), names)  # noqa: S102
    assert names["data"].ctrl.tolist() == pytest.approx([0.9 * math.radians(27)])
    assert names["data"].joint("joint1").qpos[0] > 0.0


def test_the_message_is_the_one_of_the_page(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    wrong = block("yaml").replace("{1: {id: leg", "{0: {id: leg")
    Path("walker.yaml").write_text(wrong)
    with pytest.raises(InvalidRobot) as error:
        read_robot(Path("walker.yaml"))
    (quoted,) = re.findall(r"^    (walker\.yaml:.*)$", PAGE.read_text(), re.MULTILINE)
    assert str(error.value) == quoted
