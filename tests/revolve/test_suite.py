"""``revolve suite``: its frozen protocol, shipped scores, comparison, refusals."""

import json
import shlex
import statistics
from pathlib import Path

import pytest
from msgspec.structs import replace
from scipy import stats

import revolve as rv
from revolve.command import main
from revolve.suite.protocol import obeying, read_protocol
from revolve.suite.score import (
    REFERENCES,
    WINDOWS,
    completed,
    read_score,
    score_text,
)
from schema.agent.stopping import STOPPED, advise, tell_stopped

FROZEN = "601d55b8f1be7cc8da27ba1add0c7f4902545d6e777e1bac869a1a0f3d73e09a"
SHIPPED = Path(rv.__file__).parent / "suite"
ROWS = Path(__file__).parents[2] / "docs" / "data" / "suite"


def test_protocol_of_version_one_is_frozen() -> None:
    assert read_protocol().digest == FROZEN


def test_tasks_are_the_shipped_ones_and_the_rest_is_that_of_the_experiment() -> None:
    mine = rv.Experiment.read("map-elites", variation={"body_epsilon": 0.2})
    tasks = obeying(read_protocol(), mine, "mine.toml")
    for name, own in tasks.items():
        shipped = "scenario1" if name == "locomotion" else name
        there = rv.Experiment.read(shipped).settings
        there["fitness"]["function"] = own.settings["fitness"]["function"]
        for key, value in own.settings.items():
            is_of_task = key in ("fitness", "environment", "simulation", "vetting")
            source = there if is_of_task else mine.settings
            assert key in ("name", "births") or value == source[key], (name, key)
        assert (own.name, own.births) == (name, 600)


@pytest.mark.parametrize("path", [*SHIPPED.glob("*.json"), *ROWS.glob("*.json")])
def test_shipped_scores_are_what_the_command_writes(path: Path) -> None:
    protocol = read_protocol()
    score = read_score(str(path), protocol)
    references = {name: read_score(name, protocol) for name in REFERENCES}
    assert score_text(completed(score, references)) == path.read_text()
    for task, own in score.tasks.items():
        for window in WINDOWS:
            values = getattr(own, window)
            assert own.medians[window][1] == pytest.approx(
                statistics.median(values), rel=1e-5
            )
            other = getattr(references["scenario1"].tasks[task], window)
            row = own.against["scenario1"][window]
            test = stats.ttest_ind(values, other, equal_var=False)
            ends = test.confidence_interval()
            assert [row["difference_low"], row["difference_high"]] == pytest.approx(
                [ends.low, ends.high], rel=1e-5
            )


def test_compare_judges_each_task_and_window(
    capsys: pytest.CaptureFixture[str],
) -> None:
    assert main(["suite", "compare", "scenario1", "no-reproduction"]) == 0
    first, second, _, *rows = capsys.readouterr().out.splitlines()
    assert first == "a: scenario1, 14400 evaluations"
    assert second == "b: no-reproduction, 14400 evaluations"
    assert [row.split()[:2] for row in rows] == [
        [task, window] for task in sorted(read_protocol().tasks) for window in WINDOWS
    ]
    (row,) = (row for row in rows if row.startswith("locomotion          first"))
    assert row.endswith("a is better")
    assert main(["suite", "compare", "no-reproduction", "scenario1"]) == 0
    assert "locomotion          first" in (told := capsys.readouterr().out)
    assert "b is better" in told
    assert "a is better" not in told
    assert main(["suite", "compare", "scenario1", "scenario1"]) == 0
    assert capsys.readouterr().out.count("no difference shown") == len(rows)


@pytest.mark.parametrize(
    ("change", "problem"),
    [
        ({"version": 2}, "must be of protocol 1, 601d55b8, got 2, '601d55b8'"),
        ({"protocol": "0" * 64}, "must be of protocol 1, 601d55b8, got 1, '00000000'"),
        ({"tasks": {}}, "must have 6 runs of each of locomotion, directed-"),
        ({"births": 5}, "not a score of the suite: Object contains unknown field"),
    ],
)
def test_scores_of_another_protocol_are_not_compared(
    change: dict[str, object],
    problem: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    path = tmp_path / "other.json"
    known = json.loads((SHIPPED / "scenario1.json").read_text())
    path.write_text(json.dumps(known | change))
    assert main(["suite", "compare", str(path), "scenario1"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"revolve: {path}: {problem}")


def test_names_of_shipped_scores_are_told(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["suite", "compare", "scenario1", "random"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("revolve: random: cannot be read: ")
    assert line.endswith("; shipped are no-reproduction, scenario1")


@pytest.mark.parametrize(
    ("experiment", "problem"),
    [
        ("scenario3", "arena: must be absent in version 1 of the suite"),
        ("archipelago-ring", "islands: must be absent in version 1 of the suite"),
        ("balance", "space.planar: must be True in version 1 of the suite, got False"),
        ("bridge", "simulation.evaluation_s: must be None in version 1 of the suite"),
    ],
)
def test_experiments_that_cannot_obey_are_refused_before_anything_is_written(
    experiment: str,
    problem: str,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
) -> None:
    out = tmp_path / "out"
    words = ["suite", "run", "--experiment", experiment, "--out", str(out)]
    assert main(words) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"revolve: {experiment}: {problem}")
    assert not out.exists()


def test_experiment_that_contradicts_a_task_is_refused() -> None:
    protocol = replace(read_protocol(), births=10)
    what = "^scenario1 on locomotion: .*births"
    with pytest.raises(rv.ExperimentError, match=what):
        obeying(protocol, rv.Experiment.read("scenario1"), "scenario1")


def test_a_suite_that_is_stopped_names_its_own_command(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    def stopped(*_: object) -> int:
        advise("to resume the runs: revolve resume")
        tell_stopped()
        return STOPPED

    monkeypatch.setattr("revolve.suite.runs.evolve", stopped)
    for name in ("_ADVICE", "_FINAL", "_TOLD"):
        monkeypatch.setattr(f"schema.agent.stopping.{name}", [])
    words = [
        "suite",
        "run",
        "--experiment",
        "scenario1",
        "--out",
        str(tmp_path / "a b"),
    ]
    assert main(words) == STOPPED
    (line,) = capsys.readouterr().err.splitlines()
    assert line.endswith(f"the score: {shlex.join(['revolve', *words])}")
