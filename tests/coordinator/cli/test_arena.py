"""Orders of ``revolve arena``: which robots and runs they name."""

from pathlib import Path

import pytest

from coordinator.cli import arena
from coordinator.cli.arena import _action, coordinator_of, parser
from schema.errors import NetworkError
from schema.robot.ids import BirthId
from schema.wire.operator import RemoveRobot, SetBrain
from schema.wire.status import RunStatus, Status

ROBOT = Path(__file__).parents[2] / "data" / "documents-3063df1" / "parts.yaml"


@pytest.mark.parametrize(
    ("birth", "island", "expected"),
    [
        ("17", 0, BirthId(0, 17)),
        ("17", 1, BirthId(1, 17)),
        ("0:17", 1, BirthId(0, 17)),
        ("2:0", 0, BirthId(2, 0)),
    ],
)
def test_a_robot_is_of_the_arena_or_of_the_island_that_its_name_has(
    birth: str, island: int, expected: BirthId
) -> None:
    where = ("--island", str(island))
    removed = _action(parser().parse_args(["remove", birth, *where]))
    assert removed == RemoveRobot(expected)
    changed = _action(parser().parse_args(["brain", birth, str(ROBOT), *where]))
    assert isinstance(changed, SetBrain)
    assert changed.birth == expected


@pytest.mark.parametrize("birth", ["x", "1:", ":1", "1:2:3", "0:-1"])
def test_a_name_of_another_form_is_refused(
    birth: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(SystemExit):
        parser().parse_args(["remove", birth])
    expected = f"BIRTH: must be N or ISLAND:N in whole numbers >= 0, got {birth!r}"
    assert expected in capsys.readouterr().err


@pytest.fixture
def coordinators(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two coordinators with three runs answer."""

    def status(*folders: str) -> Status:
        runs = tuple(RunStatus(each, "zoo", 0, "running") for each in folders)
        return Status(runs, workers=1, analyzers=1, births_per_s=0.0)

    found = {"a": status("runs/zoo-0"), "b": status("runs/wet-zoo-0", "runs/zoo-1")}
    monkeypatch.setattr(arena, "ask_status", lambda _options: found)


@pytest.mark.usefixtures("coordinators")
@pytest.mark.parametrize(
    ("name", "expected", "told"),
    [
        ("zoo-0", "a", "arena of runs/zoo-0"),
        ("t-zoo-0", "b", "arena of runs/wet-zoo-0"),
        ("zoo-1", "b", "arena of runs/zoo-1"),
    ],
)
def test_a_run_is_named_by_its_whole_name_or_the_end_of_it(
    name: str, expected: str, told: str
) -> None:
    found = coordinator_of(parser().parse_args(["list", "--run", name]))
    assert found == (expected, told)


@pytest.mark.usefixtures("coordinators")
@pytest.mark.parametrize("name", ["-0", "", "pond"])
def test_a_name_of_several_runs_or_of_none_is_refused(name: str) -> None:
    choices = r"choose one by --run: zoo-0, wet-zoo-0, zoo-1$"
    with pytest.raises(NetworkError, match=f"must have a run '{name}', .*{choices}"):
        coordinator_of(parser().parse_args(["list", "--run", name]))
