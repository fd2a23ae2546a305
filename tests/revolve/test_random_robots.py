"""``revolve robot random``: random robots in files."""

from pathlib import Path
from zipfile import ZipFile

import pytest

import revolve as rv
from analyzer.report import analyze
from revolve.cli.random_robots import main
from schema.experiment.document import Vetting
from schema.formats.files import read_robot
from schema.parts import BUILT_IN

RECORDED = Path(__file__).parents[1] / "data" / "runs-3063df1"


def robots_of(tmp_path: Path, count: int, *words: str) -> list[rv.Robot]:
    """Return the robots that the command writes with seed 7."""
    file = tmp_path / "r.yaml"
    given = ["--seed", "7", "--count", str(count), *words]
    assert main(["robot random", str(file), *given]) == 0
    names = [f"r-{number}.yaml" for number in range(count)]
    return [rv.Robot.read(tmp_path / name) for name in names]


def test_robots_are_the_founders_of_a_run_of_the_seed(tmp_path: Path) -> None:
    """Of the eight founders of a recorded run, some needed several attempts."""
    with ZipFile(RECORDED / "off-line.zip") as archive:
        archive.extractall(tmp_path)
    run = rv.Run(tmp_path / "undisturbed")
    attempts = run.births["attempts"].to_pylist()[:8]
    assert max(attempts) > 1
    experiment = str(RECORDED / "off-line.toml")
    found = robots_of(tmp_path, 8, "--experiment", experiment)
    assert found == [run.robot(number) for number in range(8)]


def test_robots_are_viable_unless_told_otherwise(tmp_path: Path) -> None:
    for words, expected in (((), {True}), (("--unvetted",), {True, False})):
        robots_of(tmp_path, 12, *words)
        reports = [
            analyze(read_robot(file), BUILT_IN, Vetting())
            for file in sorted(tmp_path.glob("r-*.yaml"))
        ]
        assert len(reports) == 12
        assert {report.is_viable for report in reports} == expected


def test_unvetted_robots_are_those_of_python(tmp_path: Path) -> None:
    expected = [rv.Robot.random(seed=7, number=number) for number in range(3)]
    assert robots_of(tmp_path, 3, "--unvetted") == expected


def test_a_search_without_viable_robots_ends(tmp_path: Path) -> None:
    """A tolerance of 1 m takes all parts for touching ones."""
    strict = tmp_path / "strict.toml"
    vetting = 'mode = "contact"\ntolerance_m = 1.0'
    strict.write_text(
        f'name = "strict"\n[vetting]\n{vetting}\n[generation]\nmax_tries = 3'
    )
    with pytest.raises(rv.ExperimentError, match=r"= 3 attempts, .* intersect"):
        robots_of(tmp_path, 1, "--experiment", str(strict))
