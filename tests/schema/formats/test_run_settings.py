"""Robot files in run folders: the experiment of the run applies."""

import sys
from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest

from coordinator.storage.disk import replace_bytes
from schema.__main__ import main
from schema.errors import ExperimentError, InvalidRobot, RunFolderError
from schema.experiment.file import experiment_text, read_experiment
from schema.experiment.settings import evaluation_settings_of
from schema.formats.files import settings_of, write_robot
from schema.formats.run_settings import experiment_of, read_with_settings
from schema.plugins import permission
from schema.plugins.kept import keep
from schema.tables.description import Description, description_text
from schema.tables.files import parquet_path
from tests.analysis.tables import table
from tests.documents import parse_experiment
from tests.schema.robots import robot_of

BUMPY = 'name = "bumpy"\n[environment]\nroughness_m = 0.04\n'
PADDLES = """
name = "p"
[space]
part_types = ["schema.parts:CORE", "schema.parts:ACTIVE_HINGE", "MODULE:PADDLE"]
"""
PART = "from schema.parts import HINGE\nfrom dataclasses import replace\n"


pytestmark = pytest.mark.usefixtures("_nothing_allowed")


def written(folder: Path, text: str) -> Path:
    """Write the description of a run; return the path of a robot file beside it."""
    folder.mkdir(exist_ok=True)
    document = experiment_text(parse_experiment(text, str(folder.parent / "x.toml")))
    notes = keep(folder, document, replace_bytes)
    found = Description("bumpy", 0, 7, document, plugins=notes)
    (folder / "run.json").write_text(description_text(found))
    return folder / "best.yaml"


def test_file_in_a_run_folder_has_the_world_of_the_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = written(tmp_path / "run", BUMPY)
    found = experiment_of(file, None)
    assert found is not None
    assert found.environment.roughness_m == 0.04
    line = f"revolve: with the settings of {tmp_path / 'run'} (bumpy)\n"
    assert capsys.readouterr() == ("", line)


def test_run_folder_stands_for_its_best_robot(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = written(tmp_path / "run", BUMPY)
    with pytest.raises(InvalidRobot, match="got a folder"):
        read_with_settings(file.parent, None)
    write_robot(robot_of(), file)
    found = read_with_settings(file.parent, None)
    told = capsys.readouterr().err
    assert found == read_with_settings(file, None)
    assert found[1].environment.roughness_m == 0.04
    assert told == capsys.readouterr().err
    assert main(["robot", "check", str(file.parent)]) == 0


def test_named_experiment_comes_before_that_of_the_run(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = written(tmp_path / "run", BUMPY)
    assert experiment_of(file, "scenario2") == read_experiment("scenario2")
    assert capsys.readouterr().err == ""


def test_file_elsewhere_has_the_world_of_scenario1(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert experiment_of(tmp_path / "a.yaml", None) is None
    assert capsys.readouterr().err == ""
    assert experiment_of(tmp_path / "a.yaml", None, tells_default=True) is None
    assert "with the settings of scenario1;" in capsys.readouterr().err
    shipped = evaluation_settings_of(read_experiment("scenario1"))
    default = settings_of(None)
    assert (shipped.simulation, shipped.fitness) == (
        default.simulation,
        default.fitness,
    )
    assert shipped.environment == default.environment


@pytest.mark.parametrize(
    ("changed", "is_said"),
    [("", False), ("[islands.simulation]\nfriction = 0.5", True)],
)
def test_islands_of_different_worlds_are_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], changed: str, *, is_said: bool
) -> None:
    text = f'name = "two"\n[[islands]]\n[[islands]]\n{changed}\n'
    experiment_of(written(tmp_path / "run", text), None)
    assert ("island 0; --island names" in capsys.readouterr().err) == is_said


def test_best_robot_has_the_world_of_the_island_where_it_is_the_best(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    text = 'name = "two"\n[[islands]]\n[[islands]]\n[islands.simulation]\n'
    file = written(tmp_path / "run", f"{text}friction = 0.5\n")
    rows: list[dict[str, Any]] = [
        {"island": 0, "births": 3, "birth": 1, "fitness": 0.9},
        {"island": 0, "births": 5, "birth": 2, "fitness": 0.2},
        {"island": 0, "births": 5, "birth": 4, "fitness": None},
        # A copy of a migrant from island 0.
        {"island": 1, "births": 4, "birth": 2, "birth_island": 0, "fitness": 0.3},
    ]
    path = parquet_path(tmp_path / "run", "bumpy", 0, "population")
    path.parent.mkdir(parents=True)
    pq.write_table(table("population", rows), path)
    frictions = []
    for name, island in (("best", None), ("best", 0), ("mine", None), ("mine", 1)):
        found = experiment_of(file.with_stem(name), None, island)
        assert found is not None
        frictions.append(found.simulation.friction)
    default = read_experiment("scenario1").simulation.friction
    assert frictions == [0.5, default, default, 0.5]
    said = [
        line.partition("(two), ")[2] for line in capsys.readouterr().err.split("\n")
    ]
    best = (
        "island 1, where it is the best of the last population; --island names another"
    )
    other = "island 0; --island names another"
    assert said == [best, "island 0", other, "island 1", ""]


def test_island_that_is_not_there_is_refused(tmp_path: Path) -> None:
    file = written(tmp_path / "run", 'name = "two"\n[[islands]]\ncount = 2\n')
    with pytest.raises(ExperimentError, match=r"^--island must be in 0\.\.1, got 2$"):
        experiment_of(file, None, 2)
    with pytest.raises(ExperimentError, match=r"^--island must be in 0\.\.0, got 2$"):
        experiment_of(file, "scenario1", 2)
    with pytest.raises(ExperimentError, match="in no run folder; name an exp"):
        experiment_of(tmp_path / "a.yaml", None, 0)


def test_damaged_description_is_refused(tmp_path: Path) -> None:
    file = written(tmp_path / "run", BUMPY)
    (tmp_path / "run" / "run.json").write_text("{}")
    with pytest.raises(RunFolderError, match=r"run\.json: damaged"):
        experiment_of(file, None)


@pytest.fixture
def paddle(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Return a robot file with an own part type in a run folder."""
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    module = tmp_path.name.replace("-", "_")
    text = f'{PART}PADDLE = replace(HINGE, name="Paddle")\n'
    (tmp_path / f"{module}.py").write_text(text)
    file = written(tmp_path / "run", PADDLES.replace("MODULE", module))
    file.write_text(
        "body: {type: Core, children: {0: {slot: 0, type: Paddle}}}\nbrain: {}\n"
    )
    (tmp_path / f"{module}.py").unlink()
    # As in another process.
    del sys.modules[module]
    permission._allowed.clear()
    permission._copies.clear()
    return file


def test_own_part_types_of_the_run_are_known(
    paddle: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["robot", "show", str(paddle)]) == 0
    assert "part-1 Paddle" in capsys.readouterr().out


def test_mjcf_file_of_the_run_has_its_own_settings_and_the_runs_part_types(
    paddle: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    mjcf = paddle.with_suffix(".xml")
    assert main(["robot", "convert", str(paddle), str(mjcf)]) == 0
    own = experiment_of(paddle, None)
    permission._allowed.clear()
    permission._copies.clear()
    capsys.readouterr()
    robot, settings, found = read_with_settings(mjcf, None)
    line = f"revolve: with the settings in {mjcf}; --experiment names others\n"
    assert capsys.readouterr().err == line
    assert ([part.kind for part in robot.parts], found) == (["Core", "Paddle"], None)
    assert settings == settings_of(own)
    with pytest.raises(InvalidRobot, match=r"must be one of .*, got 'Paddle'"):
        read_with_settings(mjcf, "scenario1")
    capsys.readouterr()
    _, settings, found = read_with_settings(mjcf, None, 0)
    assert (settings, found) == (settings_of(own), own)
    assert "the settings of " in capsys.readouterr().err


def test_settings_of_an_mjcf_file_elsewhere_are_named_where_they_count(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "core.xml"
    write_robot(robot_of(), path)
    read_with_settings(path, None)
    assert capsys.readouterr().err == ""
    read_with_settings(path, None, tells_default=True)
    assert f"with the settings in {path}; --exp" in capsys.readouterr().err


def test_plug_in_of_another_user_is_not_imported(
    paddle: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(paddle.parents[1] / "another"))
    with pytest.raises(ExperimentError, match="was not written by a run of yours"):
        main(["robot", "show", str(paddle)])


def test_unknown_part_type_elsewhere_asks_for_the_experiment(paddle: Path) -> None:
    moved = paddle.rename(paddle.parents[1] / "moved.yaml")
    message = r"must be one of .*, got 'Paddle' .*\(name the experiment with its"
    with pytest.raises(InvalidRobot, match=message):
        main(["robot", "show", str(moved)])
