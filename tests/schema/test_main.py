"""``revolve robot``: check, convert, show."""

from pathlib import Path

import pytest

from schema.__main__ import main
from schema.errors import InvalidRobot
from schema.formats.files import read_robot
from schema.formats.mjcf import read_mjcf

TEXT = """\
body:
  type: Core
  children:
    1: {slot: 1, id: leg, type: ActiveHinge, orientation: 270}
    3: {slot: 0, type: ParametricBarJoint, params: {connection_length: 33}}
brain:
  neurons: [{part: leg, layer: output, type: Sigmoid, params: {bias: 0.125}}]
  connections: [{source: part-0-in-2, target: leg-out-0, weight: 0.25}]
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


def experiment_of(path: Path, settings: str) -> tuple[str, str]:
    """Return the flag of an experiment beside a file."""
    experiment = path.with_name("mine.toml")
    experiment.write_text(f'name = "mine"\n{settings}')
    return "--experiment", str(experiment)


WHEELED = """
[space]
part_types = ["schema.parts:CORE", "schema.robogen_parts:ACTIVE_WHEEL"]
"""


def said(capsys: pytest.CaptureFixture[str], *words: str) -> str:
    assert main(["robot", "check", *words]) == 0
    return capsys.readouterr().out.strip()


def test_a_viable_robot(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    body = "3 parts, 1 joint, 1 with a motor"
    sizes = f"{body}, 6 inputs, 1 output, 0 hidden neurons, 1 connection"
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
    named = experiment_of(path, '[vetting]\nmode = "contact"\ntolerance_m = 1.0')
    found = said(capsys, str(path), *named)
    assert "not viable: parts 1 (ActiveHinge) and 2 " in found


def test_mjcf_keeps_its_settings_and_part_types(path: Path, tmp_path: Path) -> None:
    light = experiment_of(path, f"{WHEELED}[simulation]\ngravity = 3.0")
    path.write_text("body: {type: Core, children: {1: {slot: 0, type: ActiveWheel}}}")
    there, again = tmp_path / "robot.xml", tmp_path / "again.xml"
    assert main(["robot", "convert", str(path), str(there), *light]) == 0
    assert main(["robot", "convert", str(there), str(again)]) == 0
    assert read_mjcf(again) == read_mjcf(there)
    assert read_mjcf(again)[1].simulation.gravity == 3.0
    assert main(["robot", "show", str(again)]) == 0
    named = ["--experiment", "scenario1"]
    with pytest.raises(InvalidRobot, match=r"must be one of .*, got 'ActiveWheel'"):
        main(["robot", "show", str(again), *named])


def test_show(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["robot", "show", str(path)]) == 0
    shown = capsys.readouterr().out
    for words in (
        "slot 1: part-1 ActiveHinge, by its slot 1, orientation 270",
        "slot 3: part-2 ParametricBarJoint, by its slot 0, orientation 0",
        "connection_length 33 mm",
        "alpha 0 rad",
        "part-1-out-0 Sigmoid(bias 0.125, gain 0.5)",
        "0.25 × part-0-in-2",
    ):
        assert words in shown


def test_show_has_the_units_of_parameters(
    path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path.write_text(
        "body: {type: Core, children: {1: {slot: 0, type: ActiveWheel, id: wheel, "
        "params: {radius: 45}}}}\nbrain: {neurons: [{part: wheel, layer: output, "
        "type: Oscillator, params: {period: 2.5, phase_offset: 0.25}}]}"
    )
    assert main(["robot", "show", str(path), *experiment_of(path, WHEELED)]) == 0
    shown = " ".join(capsys.readouterr().out.replace("│", " ").split())
    assert "orientation 0°, radius 45 mm" in shown
    assert "Oscillator(period 2.5 s, phase_offset 0.25 periods, amplitude 1)" in shown


def test_robots_without_experiment_have_all_built_in_neuron_types(
    path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path.write_text(
        "body: {type: Core, children: {1: {slot: 0, id: leg, type: ActiveHinge}}}\n"
        "brain: {neurons: [{part: leg, layer: output, type: PhaseOscillator, "
        "params: {frequency: 0.75}}]}"
    )
    assert main(["robot", "show", str(path)]) == 0
    assert "PhaseOscillator(frequency 0.75 Hz, " in capsys.readouterr().out
    there, back = path.with_suffix(".pb"), path.with_suffix(".yml")
    assert main(["robot", "convert", str(path), str(there)]) == 0
    assert main(["robot", "convert", str(there), str(back)]) == 0
    assert read_robot(path) == read_robot(there) == read_robot(back)
    # MJCF holds settings: those of the default brain type do not allow it.
    with pytest.raises(InvalidRobot, match=r"one of Simple, .* got 'PhaseOscillator'"):
        main(["robot", "convert", str(path), str(path.with_suffix(".xml"))])


def test_part_types_of_an_experiment(
    path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.syspath_prepend(Path(__file__).parents[1] / "plugins")
    types = '"schema.parts:CORE", "schema.parts:ACTIVE_HINGE", "flippers:FLIPPER"'
    named = experiment_of(path, f"[space]\npart_types = [{types}]")
    words = ["robot", "show", str(path), *named]
    with pytest.raises(InvalidRobot, match="must be one of Core, ActiveHinge, Flipper"):
        main(words)
    bar = "type: ParametricBarJoint, params: {connection_length: 33}"
    path.write_text(TEXT.replace(bar, "type: Flipper"))
    assert main(words) == 0


def test_help_has_an_example(capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises(SystemExit):
        main(["robot", "--help"])
    assert "examples:\n  revolve robot check" in capsys.readouterr().out
