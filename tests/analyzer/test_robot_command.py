"""``revolve robot check``: form and viability of the robot of a file."""

from pathlib import Path

import pytest

from analyzer.robot_command import main
from schema.errors import InvalidRobot

LEG = "{slot: 1, id: leg, type: ActiveHinge, orientation: 270}"
TEXT = f"""\
body:
  type: Core
  children:
    1: {LEG}
    3: {{slot: 0, type: ParametricBarJoint, params: {{connection_length: 33}}}}
brain:
  neurons: [{{part: leg, layer: output, type: Sigmoid, params: {{bias: 0.125}}}}]
"""
CURL = """\
body:
  type: Core
  children:
    1: {type: FixedBrick, children: {3: {type: FixedBrick, children: {3: {type:
      FixedBrick, children: {3: {type: FixedBrick}}}}}}}
    3: {slot: 0, id: leg, type: ActiveHinge}
brain: {neurons: [{part: leg, layer: output, type: Simple}]}
"""


@pytest.fixture
def path(tmp_path: Path) -> Path:
    file = tmp_path / "robot.yaml"
    file.write_text(TEXT)
    return file


def said(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    assert main(["robot check", *words]) == 0
    return capsys.readouterr().out.strip()


def test_a_viable_robot(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    sizes = "3 parts, 6 inputs, 1 output, 0 hidden neurons, 0 connections"
    assert said(capsys, str(path)) == f"{path}: well formed; {sizes}; viable"


def test_a_body_without_motor_is_not_viable(
    path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path.write_text("body: {type: Core, children: {0: {type: FixedBrick}}}")
    assert said(capsys, str(path)).endswith("; not viable: no part has a motor")


def test_parts_that_intersect_are_named(
    path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Four bricks, each to the same side of the last, meet where they began."""
    path.write_text(CURL)
    found = said(capsys, str(path))
    assert "well formed; 6 parts" in found
    assert "; not viable: parts " in found
    assert "(FixedBrick) intersect" in found


def test_vetting_is_that_of_the_experiment(
    path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    experiment = path.with_name("mine.toml")
    vetting = 'mode = "contact"\ntolerance_m = 1.0'
    experiment.write_text(f'name = "mine"\n[vetting]\n{vetting}')
    words = (str(path), "--experiment", str(experiment))
    assert "not viable: parts 1 (ActiveHinge) and 2 " in said(capsys, *words)


def test_a_wrong_file_is_refused(path: Path) -> None:
    path.write_text(TEXT.replace("leg,", "leg, leg: 1,"))
    with pytest.raises(
        InvalidRobot, match=r"robot\.yaml:4: part 'leg': leg: no such key"
    ):
        main(["robot check", str(path)])
