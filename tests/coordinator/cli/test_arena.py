"""Orders of ``revolve arena``: which robots and runs they name."""

from pathlib import Path

import pytest

from coordinator.cli.arena import _action, parser
from schema.robot.ids import BirthId
from schema.wire.operator import RemoveRobot, SetBrain

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
