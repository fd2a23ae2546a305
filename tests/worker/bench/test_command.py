"""Command ``revolve bench evaluate``."""

import re
from pathlib import Path

import pytest

from analyzer.report import analyze
from coordinator.evolution.generation import generate
from schema.errors import RevolveError, counted
from worker.bench.arena_bench import RobotSource
from worker.bench.command import main

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
