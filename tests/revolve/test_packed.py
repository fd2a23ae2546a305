"""Packed robots, bodies and forms of robots by the Python API; ``robot pack``."""

import dataclasses
import pickle
from pathlib import Path

import mujoco
import pytest

import revolve as rv
from analyzer.report import analyze
from revolve.command import main
from revolve.robot import plain
from schema.experiment.document import Vetting
from schema.parts import ACTIVE_HINGE, BUILT_IN
from tests.schema.robots import robot_of

Places = tuple[tuple[str, int, int], ...]


def grown(*parts: tuple[str, int, int]) -> rv.Robot:
    """Return a robot of parts (type, parent, slot of the parent) on a core."""
    rest = [
        rv.Part(
            kind,
            parent,
            place,
            0,
            0,
            tuple(p.default for p in BUILT_IN[kind].parameters),
        )
        for kind, parent, place in parts
    ]
    robot = robot_of(*rest)
    return rv.Robot(robot.parts, robot.brain)


# Worked out by hand: insert, delete and change of type cost 1, another slot 1.
@pytest.mark.parametrize(
    ("first", "second", "distance"),
    [
        ((), (), 0),
        ((), (("FixedBrick", 0, 0),), 1),
        ((("FixedBrick", 0, 0),), (("Hinge", 0, 0),), 1),
        ((("FixedBrick", 0, 0),), (("Hinge", 0, 1),), 2),
        ((("FixedBrick", 0, 0), ("Hinge", 1, 1)), (("Hinge", 0, 0),), 2),
    ],
)
def test_body_distances_by_hand(first: Places, second: Places, distance: int) -> None:
    assert rv.body_distance(grown(*first), grown(*second)) == distance
    assert rv.body_distance(grown(*second), grown(*first)) == distance


def test_a_body_is_vetted_as_by_the_analyzer() -> None:
    robot = rv.Robot.random(seed=1, number=5)
    assert rv.vet(robot) == analyze(plain(robot), BUILT_IN, Vetting())
    assert rv.vet(grown()).reason == "no part has a motor"
    light = grown(("LightSensor", 0, 0))
    assert rv.vet(light).mass > rv.vet(grown()).mass
    with pytest.raises(rv.InvalidRobot, match="LightSensor"):
        rv.vet(light, "scenario1")


def test_forms_of_a_robot_are_those_of_its_files(tmp_path: Path) -> None:
    robot = rv.Robot.random(seed=1, number=5)
    for name in ("robot.pb", "robot.xml"):
        robot.write(tmp_path / name)
    assert robot.to_bytes() == (tmp_path / "robot.pb").read_bytes()
    assert robot.to_mjcf() == (tmp_path / "robot.xml").read_text()
    assert mujoco.MjModel.from_xml_string(robot.to_mjcf()).nu == rv.vet(robot).motors
    assert robot.part_types["ActiveHinge"] == ACTIVE_HINGE
    assert "LightSensor" not in robot.part_types


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> rv.Run:
    """Return a run of two islands that differ."""
    folder = tmp_path_factory.mktemp("runs")
    text = """name = "two"
births = 20
[selection]
population = 6
[[islands]]
[[islands]]
[islands.simulation]
friction = 0.5
"""
    return rv.run(rv.Experiment.from_toml(text), out=folder / "run", workers=1)


def packed(words: str, folder: Path) -> rv.Robot:
    """Return the robot that ``robot pack`` writes."""
    out = str(folder / "out.robot")
    assert main(["robot", "pack", *words.split(), out]) == 0
    return rv.Robot.read(out)


def test_a_packed_robot_has_the_settings_of_its_island(
    run: rv.Run, tmp_path: Path
) -> None:
    best, ever = run.best()[0], run.best_ever()[0]
    for words, robot in (("", best), ("--robot best-ever", ever)):
        again = packed(f"{run.folder} {words}", tmp_path)
        assert (again, again.experiment) == (robot, robot.experiment)
        assert again.origin == robot.origin
    births = {(row["island"], row["birth"]): row for row in run.births.to_pylist()}
    judged = run.evaluations.to_pylist()
    for island, number in ((0, 3), (1, 17)):
        again = packed(f"{run.folder} --robot {island}:{number}", tmp_path)
        assert again.origin is not None
        row = births[island, number]
        assert again == run.robot(number, island)
        assert again.origin.run_id == row["run_id"] == run.run_id
        couple = [(each["island"], each["birth"]) for each in row["parents"]]
        assert (again.origin.birth, [*again.origin.parents]) == (
            (island, number),
            couple,
        )
        (fitness,) = [
            each["fitness"]
            for each in judged
            if (each["island"], each["birth"]) == (island, number)
        ]
        assert again.origin.fitness == rv.evaluate(again).fitness == fitness
        friction = again.experiment.settings["simulation"]["friction"]  # type: ignore[union-attr]
        assert friction == (0.5 if island else 1.0)


def test_a_changed_copy_has_no_origin(run: rv.Run) -> None:
    best = run.best()[0]
    assert best.origin is not None
    assert pickle.loads(pickle.dumps(best)).origin == best.origin  # noqa: S301
    changed = dataclasses.replace(best, brain=run.robot(0).brain)
    assert (changed.origin, changed.experiment) == (None, best.experiment)


def test_a_file_is_packed_with_the_settings_that_apply_to_it(
    run: rv.Run, tmp_path: Path
) -> None:
    robot = rv.Robot.random(seed=1, number=5)
    robot.write(tmp_path / "some.yaml")
    alone = packed(str(tmp_path / "some.yaml"), tmp_path)
    assert (alone, alone.experiment, alone.origin) == (robot, robot.experiment, None)
    named = packed(f"{tmp_path}/some.yaml --experiment scenario2", tmp_path)
    assert named.experiment == rv.Experiment.read("scenario2")
    of_run = packed(f"{run.folder}/best.yaml", tmp_path)
    assert of_run.experiment == run.best()[0].experiment
    once = packed(str(run.folder), tmp_path)
    once.write(tmp_path / "once.robot")
    assert packed(str(tmp_path / "once.robot"), tmp_path).origin == once.origin


@pytest.mark.parametrize(
    ("words", "line"),
    [
        ("{run} out.yaml", "out.yaml: must end in .robot, got '.yaml'"),
        ("gone.yaml out.robot", "gone.yaml: cannot be read: No such file"),
        ("{run} out.robot --robot 2:1", "has no birth 1 on island 2"),
        ("{run} out.robot --robot best-evr", "must be N or ISLAND:N in whole numbers"),
        (
            "{run} out.robot --experiment scenario1",
            "--robot is for a run, --experi",
        ),
        (
            "{run}/best.yaml out.robot --robot 3",
            "--robot is for a run, --experi",
        ),
        ("{run}/best.yaml out.robot --experiment scenaro1", "did you mean 'scenario1'"),
        (". out.robot", ".: no run is there (run.json is missing)"),
        (
            "{run}/best.yaml gone/out.robot",
            "gone/out.robot: cannot be written: No such",
        ),
        ("light.yaml out.robot --experiment scenario1", "type: must be one of Core, "),
    ],
)
def test_mistakes_are_one_line_and_write_nothing(
    words: str,
    line: str,
    *,
    run: rv.Run,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("light.yaml").write_text(
        "body: {type: Core, children: {0: {type: LightSensor}}}"
    )
    try:
        code = main(["robot", "pack", *words.format(run=run.folder).split()])
    except SystemExit as stop:
        code = int(str(stop.code))
    said = capsys.readouterr().err.splitlines()
    assert code == 2
    assert line in said[-1]
    assert len(said) == 1
    assert not list(tmp_path.rglob("*.robot"))
