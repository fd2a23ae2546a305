"""``revolve robot random``: random robots in files."""

from pathlib import Path

import pytest

from coordinator.cli.robot import main
from schema.formats.files import read_robot


def test_random_robots_differ_and_repeat_with_the_seed(tmp_path: Path) -> None:
    words = ["robot random", str(tmp_path / "r.yaml"), "--seed", "7", "--count", "2"]
    assert main(words) == 0
    robots = [read_robot(tmp_path / f"r-{number}.yaml") for number in range(2)]
    assert robots[0] != robots[1]
    assert all(len(robot.parts) >= 3 for robot in robots)
    assert main(["robot random", str(tmp_path / "one.pb"), "--seed", "7"]) == 0
    assert read_robot(tmp_path / "one.pb") == robots[0]


@pytest.mark.parametrize(
    ("flag", "value", "limits"),
    [
        ("--seed", "-1", "in 0..18446744073709551615"),
        ("--seed", str(2**64), "in 0..18446744073709551615"),
        ("--count", "1.5", ">= 1"),
        ("--count", "0", ">= 1"),
    ],
)
def test_invalid_numbers_are_refused(
    flag: str,
    value: str,
    limits: str,
    capsys: pytest.CaptureFixture[str],
    tmp_path: Path,
) -> None:
    with pytest.raises(SystemExit) as end:
        main(["robot random", str(tmp_path / "r.yaml"), flag, value])
    assert end.value.code == 2
    message = f"{flag}: must be a whole number {limits}, got '{value}'"
    assert message in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
