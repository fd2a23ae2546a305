"""What is said at the end of a run and of a campaign, worked out by hand."""

from pathlib import Path
from typing import Any

import pyarrow.parquet as pq
import pytest
from msgspec import structs

from coordinator.cli import summary
from coordinator.cli.campaign_table import (
    RunOutcome,
    columns,
    outcome_of,
    show_outcomes,
)
from coordinator.storage.folder_status import births_of
from schema.errors import RunFolderError
from schema.experiment.document import (
    ArenaSection,
    Experiment,
    Fitness,
    Islands,
    Simulation,
    island_experiment,
    island_experiments,
)
from schema.formats.files import BEST, read_robot
from schema.robot.robot import Robot
from schema.tables.files import parquet_path
from tests.analysis.tables import table


@pytest.mark.parametrize("screen", ["", ":0"])
@pytest.mark.parametrize("viewer", [None, object()])
def test_only_commands_that_work_are_suggested(
    viewer: object, screen: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    monkeypatch.setenv("DISPLAY", screen)
    monkeypatch.setattr(summary, "find_spec", lambda _name: viewer)
    best = tmp_path / BEST
    view = f"view {tmp_path}" if screen else f"view {tmp_path} --save run.rrd"
    show = f"robot show {best}" if viewer is None else view
    analyze = f"  revolve analyze {tmp_path}"
    extinct = [] if viewer is None else [f"  revolve {view}"]
    assert summary.next_steps(tmp_path) == [*extinct, analyze]
    best.touch()
    render = f"  revolve robot render {best} best.gif"
    assert summary.next_steps(tmp_path) == [render, f"  revolve {show}", analyze]


def judged_apart(*islands: Islands) -> list[str]:
    return summary.judged_apart(island_experiments(Experiment("e", islands=islands)))


def test_islands_that_judge_in_other_ways_are_said() -> None:
    alike = (Islands(count=2), Islands(fitness=Fitness()))
    assert judged_apart(*alike) == []
    others = (Islands(fitness=Fitness(limit=0.5)), Islands(arena=ArenaSection()))
    (line,) = judged_apart(*alike, *others)
    assert line == (
        "fitness of different islands is not comparable: locomotion on islands 0, 1, "
        "2; locomotion (limit = 0.5) on island 3; locomotion in an arena on island 4"
    )


def test_windows_of_all_arenas_are_said() -> None:
    slow = Simulation(timestep_s=0.01, window_steps=600)
    own = Islands(arena=ArenaSection(), simulation=slow)
    experiment = Experiment("e", arena=ArenaSection(), islands=(Islands(), own))
    arenas = [island_experiment(experiment, number) for number in range(2)]
    (line,) = summary._windows(arenas)
    what = "a robot's last 6 or 12 s before the last birth"
    assert line == f"in arenas fitness is that of {what}"
    (line,) = summary._windows(arenas[1:])
    assert "last 6 s before" in line


def write_tables(folder: Path, rows: dict[str, list[dict[str, Any]]]) -> None:
    for name, own in rows.items():
        path = parquet_path(folder, "e", 0, name)
        path.parent.mkdir(parents=True, exist_ok=True)
        pq.write_table(table(name, own), path)


@pytest.mark.parametrize(
    ("births", "islands", "is_extinct"),
    [
        (3, (), True),
        (2, (), False),
        (3, (Islands(births=2),), False),
        (3, (Islands(), Islands()), True),
    ],
)
def test_run_is_extinct_if_all_of_its_arenas_have_too_few_births(
    tmp_path: Path, births: int, islands: tuple[Islands, ...], *, is_extinct: bool
) -> None:
    experiment = Experiment("e", births=births, arena=ArenaSection(), islands=islands)
    write_tables(tmp_path, {"births": [{"birth": 0}, {"birth": 1}]})
    born = births_of(tmp_path)
    assert summary._is_extinct(tmp_path, experiment, born) is is_extinct
    off_line = structs.replace(experiment, arena=None)
    assert not summary._is_extinct(tmp_path, off_line, born)


@pytest.mark.parametrize(
    ("sampled_s", "end_s", "is_extinct"),
    [
        pytest.param(95.0, 100.0, True, id="no sample at the end"),
        pytest.param(100.0, 100.0, False, id="sampled at the end"),
        pytest.param(100.0, 103.0, False, id="no sample is due at the end"),
        pytest.param(None, 20.0, False, id="founders until then"),
        pytest.param(100.0, 0.0, True, id="no end"),
    ],
)
def test_an_arena_with_robots_at_its_end_is_not_extinct(
    tmp_path: Path, sampled_s: float | None, end_s: float, *, is_extinct: bool
) -> None:
    """The rows of robots tell until when an arena lived."""
    founders = [{"birth": number, "sim_time_s": 10.0 * number} for number in (1, 2)]
    samples = [{"birth": 1, "sim_time_s": sampled_s}] if sampled_s else []
    write_tables(tmp_path, {"births": founders, "fitness": samples})
    experiment = Experiment("e", births=3, arena=ArenaSection(end_s=end_s))
    born = births_of(tmp_path)
    assert summary._is_extinct(tmp_path, experiment, born) is is_extinct


@pytest.mark.parametrize(
    ("births", "line"),
    [
        (3, "3 births; no robot of the last population has a fitness"),
        (2, "extinct after 2 births: no robot is left that can have a child"),
    ],
)
def test_a_run_with_all_of_its_births_is_not_extinct(
    tmp_path: Path, births: int, line: str
) -> None:
    experiment = Experiment("e", births=3, arena=ArenaSection())
    rows: list[dict[str, Any]] = [{"birth": number} for number in range(births)]
    write_tables(tmp_path, {"births": rows, "population": []})
    assert summary._results(tmp_path, experiment) == [line]


def test_robot_without_a_file_is_said(tmp_path: Path, chain: Robot) -> None:
    """A file of an earlier end of the run is removed: it is another robot."""
    core, best = Robot(chain.parts[:1], chain.brain), tmp_path / BEST
    assert summary._write_best(core, tmp_path, Experiment("e")) == f"its file: {best}"
    assert read_robot(best) == core
    line = summary._write_best(chain, tmp_path, Experiment("e"))
    assert line.startswith(f"it has no file {best}: nested too deeply for YAML: ")
    assert not best.exists()
    best.mkdir()
    with pytest.raises(RunFolderError, match=r"best\.yaml: cannot be written: "):
        summary._write_best(core, tmp_path, Experiment("e"))


@pytest.mark.parametrize(("ever", "is_said"), [(0.5, True), (0.3, False)])
def test_a_better_robot_that_died_is_named(
    tmp_path: Path, ever: float, *, is_said: bool
) -> None:
    rows: dict[str, list[dict[str, Any]]] = {
        "evaluations": [{"birth": 4, "fitness": 0.3}, {"birth": 2, "fitness": ever}],
        "fitness": [],
    }
    write_tables(tmp_path, rows)
    best = {"island": 0, "birth_island": None, "birth": 4, "fitness": 0.3}
    shown = f"revolve view {tmp_path} --robot best-ever"
    said = [f"best ever: robot 0:2, fitness 0.5000: {shown}"] if is_said else []
    assert summary._better_ever(tmp_path, best) == said


OUTCOMES = (
    RunOutcome("a", 0.1, 60.0),
    RunOutcome("b", 0.5, 100.0),
    RunOutcome("a", 0.3, 120.0),
    RunOutcome("a", 0.2, 90.0),
    RunOutcome("b", has_failed=True),
    RunOutcome("c", has_failed=True),
)


def test_the_best_robot_of_a_group_was_born_in_it(tmp_path: Path) -> None:
    write_tables(tmp_path, {"births": [{"island": 0, "birth": 3}]})
    here = {"island": 0, "birth_island": None, "birth": 3, "fitness": 0.1}
    migrant = {"island": 0, "birth_island": 1, "birth": 2, "fitness": 0.3}
    born = births_of(tmp_path)
    assert summary._best_here([migrant, here], born) == here
    assert summary._best_here([migrant], born) is None


def test_each_experiment_has_a_row() -> None:
    """0.1, 0.2, 0.3: mean 0.2, variance (0.01 + 0 + 0.01) / 2."""
    assert [*zip(*columns(OUTCOMES).values(), strict=True)] == [
        ("a", "3", "0.3000", "0.2000", "0.1000", "1 min 30 s", "0"),
        ("b", "2", "0.5000", "0.5000", "-", "1 min 40 s", "1"),
        ("c", "1", "-", "-", "-", "-", "1"),
    ]


def test_the_table_fits_80_columns_and_explains_itself(
    capsys: pytest.CaptureFixture[str],
) -> None:
    show_outcomes(OUTCOMES)
    head, *lines, note = capsys.readouterr().out.splitlines()
    assert head.split()[:3] == ["experiment", "runs", "best"]
    assert len(lines) == 3
    assert max(map(len, (head, *lines, note))) <= 80
    assert "best robot in its last population" in note


def test_points_of_a_sweep_have_their_settings(
    capsys: pytest.CaptureFixture[str],
) -> None:
    runs = [
        RunOutcome(name, 0.1, 60.0, point=point)
        for name, point in (("s-0", "a.b = 1"), ("s-1", 'a.b = 2, c = "x"'), ("d", ""))
    ]
    show_outcomes([*runs, runs[0]])
    assert capsys.readouterr().out.splitlines()[-3:] == [
        "fitness of each run's best robot in its last population",
        "s-0: a.b = 1",
        's-1: a.b = 2, c = "x"',
    ]


def test_different_fitness_functions_are_named(
    capsys: pytest.CaptureFixture[str],
) -> None:
    one, other = (
        RunOutcome(name, 0.1, 60.0, function=function)
        for name, function in (("a", "locomotion"), ("b", "goals:far"))
    )
    show_outcomes([one, one])
    assert "comparable" not in capsys.readouterr().out
    show_outcomes(iter([one, other]))
    assert capsys.readouterr().out.splitlines()[-1] == (
        "not comparable, as fitness functions differ: a locomotion, b goals:far"
    )


def test_a_folder_without_a_run_counts_as_failed(tmp_path: Path) -> None:
    expected = RunOutcome("a", has_failed=True)
    assert outcome_of(tmp_path, "a", has_failed=False) == expected
    assert outcome_of(tmp_path, "a", has_failed=True) == expected
