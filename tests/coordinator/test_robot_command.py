"""``revolve robot random``: founders on paper."""

from pathlib import Path

from coordinator.robot_command import main
from schema.robot_file import read_robot


def test_files_hold_different_robots_and_the_same_ones_again(tmp_path: Path) -> None:
    words = ["robot random", str(tmp_path / "r.yaml"), "--seed", "7", "--count", "2"]
    assert main(words) == 0
    robots = [read_robot(tmp_path / f"r-{number}.yaml") for number in range(2)]
    assert robots[0] != robots[1]
    assert all(len(robot.parts) >= 3 for robot in robots)
    assert main(["robot random", str(tmp_path / "one.pb"), "--seed", "7"]) == 0
    assert read_robot(tmp_path / "one.pb") == robots[0]
