"""Commands ``revolve bench evaluate`` and ``revolve bench fidelity``."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest
from msgspec.structs import replace

from analyzer.report import analyze
from coordinator.evolution.generation import generate
from schema.errors import ExperimentError, RevolveError, counted
from schema.experiment.document import Experiment, Fitness, Simulation
from schema.experiment.file import experiment_text
from schema.plugins.kept import KeptPlugin, kept_file
from schema.plugins.source import digest_of_sources
from schema.robot.robot import Robot
from schema.tables.description import DETAILS, Description, description_text
from tests.worker.bench.run_folder import write_run
from worker.bench.arena_bench import RobotSource
from worker.bench.command import main

SHORT = Experiment(
    name="test", simulation=Simulation(window_steps=1000, evaluation_s=(5.0, 6.0))
)
ROBOTS = RobotSource(generate, analyze)


@pytest.fixture
def run(tmp_path: Path, robot_of: Callable[[int], Robot]) -> Path:
    """Return the folder of a run of three robots."""
    numbers = range(3)
    write_run(
        tmp_path,
        SHORT,
        births=[(0, number, robot_of(number)) for number in numbers],
        evaluations=[(0, number, None, 5.5, 0.1 * number) for number in numbers],
    )
    return tmp_path


@pytest.mark.parametrize(
    ("changes", "problem"),
    [
        (
            ["pose_steps=48", "brain_steps=33"],
            "simulation.window_steps: must be a multiple of .* = 48, got 1000",
        ),
        (["armatur=0.1"], "simulation.armatur: no such key"),
    ],
)
def test_changes_are_checked_together_with_the_run(
    run: Path, changes: list[str], problem: str
) -> None:
    flags = [word for change in changes for word in ("--against", change)]
    arguments = ["bench", "fidelity", str(run), "--per-third", "1", *flags]
    with pytest.raises(ExperimentError, match=f"^--against: {problem}"):
        main(arguments, ROBOTS)


def test_changes_that_fit_the_run_only_are_possible(
    run: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """125 divides the run's window of 1000 steps, not the default one of 2400."""
    arguments = ["fidelity", str(run), "--per-third", "1", "--against"]
    main(["bench", *arguments, "pose_steps=125"], ROBOTS)
    first, thirds, *winners = capsys.readouterr().out.splitlines()
    assert first.startswith(f"3 robots of {run}: Spearman ")
    assert thirds == "  by thirds, least fit first: undefined, undefined, undefined"
    assert len(winners) == 3


def test_robots_that_all_diverge_cannot_be_timed(tmp_path: Path) -> None:
    path = tmp_path / "tiny.toml"
    path.write_text('name = "tiny"\n[simulation]\nmass_factor = 1e-9\n')
    message = "nothing to time: no evaluation succeeded, 2 robots failed; the first one"
    with pytest.raises(RevolveError, match=f"^{message}: "):
        main(["bench", "evaluate", str(path), "--robots", "2"], ROBOTS)


FALLIBLE = """
import revolve as rv

SIDE = 0.04
PLATE = rv.Shape(
    boxes=(rv.Box("plate", (0.006, SIDE, SIDE), (0.0, 0.0, 0.0), 0.03),),
    slots=(rv.Slot((-0.003, 0.0, 0.0), (-1.0, 0.0, 0.0), (0.0, 0.0, 1.0)),),
)


class Fallible:
    inputs = 1

    def read(self, view):
        if 0.5 < view.age_s < 1.0 and view.position("plate")[0] > 0.1:
            raise RuntimeError("out of order")
        return [0.0]


FOOT = rv.PartType("Foot", 1, lambda _values: PLATE, sensors=(Fallible(),))


def odd(trace, _fitness):
    if len(trace.robot.parts) % 2:
        raise RuntimeError("not even")
    return 1.0
"""


PARTS = ["schema.parts:CORE", "schema.parts:ACTIVE_HINGE", "bench_fallible:FOOT"]


@pytest.mark.parametrize(
    ("settings", "reason"),
    [
        (
            f"[space]\npart_types = {PARTS}",
            r"sensor Fallible of part \d+ \(Foot\): RuntimeError: out of order",
        ),
        (
            '[fitness]\nfunction = "bench_fallible:odd"',
            "bench_fallible:odd raised RuntimeError: not even",
        ),
    ],
)
def test_robots_whose_plug_ins_fail_are_left_out_of_timing_and_counted(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], settings: str, reason: str
) -> None:
    (tmp_path / "bench_fallible.py").write_text(FALLIBLE)
    path = tmp_path / "fallible.toml"
    path.write_text(f'name = "fallible"\n{settings}\n[simulation]\nwindow_steps = 240')
    main(["bench", "evaluate", str(path), "--robots", "4"], ROBOTS)
    first, _, last = capsys.readouterr().out.splitlines()
    timed = int(first.split()[0])
    assert 0 < timed < 4
    start = f"left out: {counted(4 - timed, 'robot')} whose evaluation failed; "
    assert re.fullmatch(f"{start}the first one: {reason}", last)


def test_fidelity_uses_the_plug_ins_that_a_run_keeps(
    run: Path, robot_of: Callable[[int], Robot], capsys: pytest.CaptureFixture[str]
) -> None:
    """A run keeps a copy of each plug-in file, which no other file has to be."""
    source = b"def still(trace, _fitness):\n    return 0.5\n"
    file = kept_file(run, "bench_kept")
    file.parent.mkdir()
    file.write_bytes(source)
    own = replace(SHORT, fitness=Fitness(function="bench_kept:still"))
    numbers = range(3)
    write_run(
        run,
        own,
        births=[(0, number, robot_of(number)) for number in numbers],
        evaluations=[(0, number, None, 5.5, 0.1 * number) for number in numbers],
    )
    note = KeptPlugin(digest_of_sources([file]), str(file))
    known = Description("test", 0, 1, experiment_text(own))
    known = replace(known, plugins={"bench_kept": note})
    (run / DETAILS).write_text(description_text(known))
    arguments = ["bench", "fidelity", str(run), "--per-third", "1"]
    with pytest.raises(ExperimentError, match=f"add --plugins bench_kept={file}$"):
        main(arguments, ROBOTS)
    main([*arguments, "--plugins", str(file)], ROBOTS)
    assert "mean 0.5000 here, 0.5000 there" in capsys.readouterr().out
