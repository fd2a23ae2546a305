"""Benchmarks of the speed of simulation on this machine.

'revolve bench evaluate' compares evaluations with bare physics steps. 'revolve bench
arena' and 'revolve bench spider' repeat the thesis's benchmarks.
"""

import argparse
import time
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import TypeVar

import mujoco
from rich.console import Console
from rich.progress import track

from schema.agent.flags import Flags, add_count
from schema.errors import FAILURES, RevolveError, counted
from schema.experiment.document import body_space
from schema.experiment.file import read_experiment
from schema.experiment.settings import EvaluationSettings, evaluation_settings_of
from schema.mjcf.model import solo_spec
from schema.robot.robot import Robot
from schema.robot.trace import Floats
from worker.bench import arena_bench
from worker.robot import evaluation

T = TypeVar("T")
_REPEATS = 7
LEAST_RATIO = 0.85
"""Goal for the ratio of bare engine time to evaluation time (design, section 9)."""


@dataclass(frozen=True, slots=True)
class Timing:
    """CPU time of whole evaluations and of their engine steps alone.

    Attributes:
        evaluation_s: build, control, sensors, fitness and steps [s].
        engine_s: the same steps with the same controls only [s].
        failures: why the evaluations of further robots failed.
    """

    robots: int
    evaluation_s: float
    engine_s: float
    failures: tuple[str, ...] = ()

    @property
    def ratio(self) -> float:
        """Share of an evaluation that the engine needs; at most 1."""
        return self.engine_s / self.evaluation_s


def time_evaluations(robots: Iterable[Robot], settings: EvaluationSettings) -> Timing:
    """Return the time of evaluations and of their bare engine steps.

    Both are timed alternately, and the least time of each counts, as other load on the
    machine only adds time. Robots whose evaluation fails are left out.
    """
    count, whole, bare = 0, 0.0, 0.0
    failures: list[str] = []
    for robot in robots:
        wholes, bares = [], []
        try:
            commands = _commands(robot, settings)
            for turn in range(2 * _REPEATS):
                if turn % 4 in {0, 3}:
                    wholes.append(_whole(robot, settings))
                else:
                    bares.append(_replay(robot, settings, commands))
        except FAILURES as error:
            failures.append(str(error))
            continue
        count += 1
        whole += min(wholes)
        bare += min(bares)
    return Timing(count, whole, bare, tuple(failures))


def _whole(robot: Robot, settings: EvaluationSettings) -> float:
    """Return the time of an evaluation [s]."""
    start = time.thread_time()
    evaluation.evaluate(robot, settings)
    return time.thread_time() - start


def _commands(robot: Robot, settings: EvaluationSettings) -> list[Floats]:
    found: list[Floats] = []
    evaluation.simulate(
        robot, settings, watch=lambda data: found.append(data.ctrl.copy())
    )
    return found


def _replay(
    robot: Robot, settings: EvaluationSettings, commands: list[Floats]
) -> float:
    """Return the time of the engine's steps under recorded controls [s]."""
    clock = settings.simulation
    space = body_space(settings.space)
    model = solo_spec(robot, space, clock, settings.environment).compile()
    data = mujoco.MjData(model)
    left = clock.evaluation_steps
    start = time.thread_time()
    for command in commands:
        data.ctrl[:] = command
        mujoco.mj_step(model, data, nstep=min(left, clock.brain_steps))
        left -= clock.brain_steps
    return time.thread_time() - start


def main(arguments: list[str], robots: arena_bench.RobotSource) -> int:
    """Run a command ``revolve bench ...``; return 0 if it meets its goal, else 1."""
    options = parser().parse_args(arguments[1:])
    if options.what == "evaluate":
        return _evaluate(options, robots)
    return arena_bench.run(options, robots)


def parser() -> Flags:
    """Return the parser of ``revolve bench``."""
    flags = Flags(
        prog="revolve bench",
        description="Benchmark simulation: its speed on this machine.",
        examples=(
            "revolve bench evaluate    # compare with bare physics steps",
            "revolve bench arena --out arena.parquet    # the thesis's benchmark",
        ),
    )
    kinds = flags.add_subparsers(dest="what", required=True, metavar="ACTION")
    timing = kinds.add_parser(
        "evaluate",
        help="time evaluations against the bare engine",
        description="Time evaluations against bare physics steps.",
        examples=(
            "revolve bench evaluate",
            "revolve bench evaluate scenario1 --robots 10 --seed 2",
        ),
    )
    arena_bench.add_experiment(timing, "scenario1")
    add_count(timing, "--robots", 30, "number of robots, drawn at random")
    add_count(timing, "--seed", 1, "random seed, of the robots", least=0)
    arena_bench.add_commands(kinds)
    return flags


def _evaluate(options: argparse.Namespace, source: arena_bench.RobotSource) -> int:
    experiment = read_experiment(options.experiment)
    robots = source.robots(experiment, options.robots, options.seed, is_vetted=False)
    settings = evaluation_settings_of(experiment)
    timing = time_evaluations(_shown(robots, "random robots"), settings)
    failed = len(timing.failures)
    if not timing.robots:
        raise RevolveError(
            f"nothing to time: no evaluation succeeded, {counted(failed, 'robot')} "
            f"failed; the first one: {timing.failures[0]}"
        )
    each_s = timing.evaluation_s / timing.robots
    print(
        f"{timing.robots} random robots: {1000 * each_s:.1f} ms CPU each, "
        f"{1 / each_s:.0f} per second and core"
    )
    print(f"bare engine / evaluation: {timing.ratio:.3f} (promised: {LEAST_RATIO})")
    if failed:
        print(
            f"left out: {counted(failed, 'robot')} whose evaluation failed; the first "
            f"one: {timing.failures[0]}"
        )
    return 0 if timing.ratio >= LEAST_RATIO else 1


def _shown(robots: Sequence[T], what: str) -> Iterable[T]:
    """Yield robots one by one and show progress on the terminal."""
    # No automatic refresh, as its time would be measured.
    console = Console(stderr=True)
    return track(robots, what, console=console, transient=True, auto_refresh=False)
