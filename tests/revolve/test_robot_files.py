"""Robot files by the Python API: with the settings that the commands take."""

import sys
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

import revolve as rv
from revolve.evaluation import settings_for
from revolve.experiment import document_of
from revolve.robot import plain
from schema.experiment.document import island_experiment
from schema.experiment.file import experiment_text
from schema.experiment.settings import evaluation_settings_of
from schema.formats.run_settings import read_with_settings
from schema.plugins import permission
from schema.plugins.kept import keep
from schema.tables.description import Description, description_text
from schema.tables.files import parquet_path
from tests.analysis.tables import table
from tests.documents import parse_experiment
from worker.robot.evaluation import evaluate

TWO = """name = "two"
[space]
part_types = ["schema.parts:CORE", "schema.parts:ACTIVE_HINGE", "MODULE:PADDLE"]
[[islands]]
[[islands]]
[islands.simulation]
friction = 0.5
"""
PADDLE = """from dataclasses import replace
from schema.parts import HINGE
PADDLE = replace(HINGE, name="Paddle")
"""
BODY = "body: {type: Core, children: {0: {slot: 0, type: Paddle}}}\nbrain: {}\n"

pytestmark = pytest.mark.usefixtures("_nothing_allowed")


def write(file: Path, data: bytes) -> None:
    file.write_bytes(data)


@pytest.fixture
def best(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return ``best.yaml`` of a run that keeps a plug-in; it is of island 1."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    module = tmp_path.name.replace("-", "_")
    (tmp_path / f"{module}.py").write_text(PADDLE)
    text = TWO.replace("MODULE", module)
    document = experiment_text(parse_experiment(text, str(tmp_path / "x.toml")))
    run = tmp_path / "run"
    (run / "plugins").mkdir(parents=True)
    notes = keep(run, document, write)
    monkeypatch.setattr(permission, "_copies", {})
    found = Description("two", 0, 7, document, plugins=notes)
    (run / "run.json").write_text(description_text(found))
    rows: list[dict[str, Any]] = [
        {"island": 0, "births": 15, "birth": 1, "fitness": 0.1},
        {"island": 1, "births": 15, "birth": 2, "fitness": 0.3},
    ]
    path = parquet_path(run, "two", 0, "population")
    path.parent.mkdir(parents=True)
    pq.write_table(table("population", rows), path)
    file = run / "best.yaml"
    file.write_text(BODY)
    # As in another process, after the plug-in was removed.
    (tmp_path / f"{module}.py").unlink()
    del sys.modules[module]
    permission._allowed.clear()
    return file


def test_a_file_of_a_run_has_the_settings_that_the_command_takes(
    best: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    robot = rv.Robot.read(best)
    assert capsys.readouterr() == ("", "")
    assert [part.kind for part in robot.parts] == ["Core", "Paddle"]
    settings = settings_for(robot, None)
    assert settings.simulation.friction == 0.5
    assert settings == read_with_settings(best, None)[1]
    assert robot.experiment is not None
    document = document_of(rv.Run(best.parent).experiment)
    assert document_of(robot.experiment) == island_experiment(document, 1)
    assert "settings of two" in repr(robot)
    other = rv.Robot.read(best.rename(best.with_name("mine.yaml")))
    assert settings_for(other, None).simulation.friction == 1.0


def test_a_named_experiment_comes_first_with_its_island_0(
    best: Path, tmp_path: Path
) -> None:
    with pytest.raises(rv.InvalidRobot, match="got 'Paddle'"):
        rv.Robot.read(best, "scenario1")
    text = 'name = "a"\n[[islands]]\n[islands.simulation]\nfriction = 0.25\n'
    (tmp_path / "a.toml").write_text(text)
    robot = rv.Robot.random("scenario1", seed=1)
    robot.write(tmp_path / "some.yaml")
    read = rv.Robot.read(tmp_path / "some.yaml", tmp_path / "a.toml")
    found = read_with_settings(tmp_path / "some.yaml", str(tmp_path / "a.toml"))
    assert found[1].simulation.friction == 0.25
    for each in (settings_for(read, None), settings_for(robot, tmp_path / "a.toml")):
        assert each == found[1]


def test_an_mjcf_file_has_the_settings_in_it(tmp_path: Path) -> None:
    changes = {"window_steps": 400, "friction": 0.5}
    experiment = rv.Experiment.read("scenario1", simulation=changes)
    robot = rv.Robot.random(experiment, seed=1)
    robot.write(tmp_path / "some.xml")
    read = rv.Robot.read(tmp_path / "some.xml")
    settings = settings_for(read, None)
    assert settings == evaluation_settings_of(document_of(experiment))
    assert evaluate(plain(read), settings) == evaluate(
        plain(robot), settings_for(robot, None)
    )
    assert rv.Robot.read(tmp_path / "some.xml", "scenario2").experiment is not None
    plainly = rv.Robot.read(tmp_path / "some.xml", "scenario2")
    assert settings_for(plainly, None) == settings_for(robot, "scenario2")
