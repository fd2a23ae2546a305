"""Benchmarks of evaluations and arenas."""

import re
from pathlib import Path

import numpy as np
import pyarrow.parquet as pq
import pytest

from analyzer.report import analyze
from coordinator.evolution.generation import generate
from schema.errors import RevolveError, counted
from schema.experiment.document import Simulation
from schema.experiment.environment import FLAT
from schema.mjcf.model import solo_spec
from schema.parts import BUILT_IN
from schema.robot.robot import check_robot
from worker.bench import command as bench
from worker.bench.arena_bench import RESULTS, RobotSource
from worker.bench.command import main
from worker.bench.spider import grid, spider

ROBOTS = RobotSource(generate, analyze)


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


def test_spider_has_mass_motors_and_height_of_the_thesis() -> None:
    """383 g, 8 servos, underside 2.25 cm below the core."""
    robot = spider()
    check_robot(robot, BUILT_IN)
    model = solo_spec(robot, BUILT_IN, Simulation(), FLAT).compile()
    assert model.body_mass.sum() == pytest.approx(0.3832)
    assert model.nu == 8
    assert model.qpos0[2] == pytest.approx(0.0225)
    assert robot.brain.count("input") == 10


def test_grid_has_rows_of_five() -> None:
    places = np.array(grid(12))
    assert places[4] == pytest.approx((1.6, 0.0))
    assert places[5] == pytest.approx((0.0, 0.4))


@pytest.mark.parametrize("what", ["arena", "spider"])
def test_benchmark_writes_a_row_per_repetition(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], what: str
) -> None:
    out = tmp_path / "results.parquet"
    words = ["--sizes", "1", "2", "3", "--seconds", "1", "--repetitions", "2", "--out"]
    assert bench.main(["bench", what, *words, str(out)], ROBOTS) == 0
    table = pq.read_table(out)
    assert table.schema.equals(RESULTS, check_metadata=True)
    assert table["population"].to_pylist() == [1, 1, 2, 2, 3, 3]
    assert table["simulated_s"].to_pylist() == [1.0] * 6
    factor, wall = table["factor"].to_numpy(), table["wall_s"].to_numpy()
    assert factor == pytest.approx(1.0 / wall)
    printed = capsys.readouterr().out
    assert printed.count("x real time") == 3
    assert ("thesis: factor = -0.26 +34.78 / p +20.41 / p^2" in printed) is (
        what == "arena"
    )


def test_unwritable_file_is_rejected_before_the_first_measurement(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out = str(tmp_path / "nowhere" / "results.parquet")
    with pytest.raises(RevolveError, match="cannot be written: No such file"):
        bench.main(["bench", "arena", "--out", out], ROBOTS)
    assert capsys.readouterr().out == ""
