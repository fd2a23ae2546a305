"""``revolve robot simulate``: simulate and evaluate the robot of a file."""

from functools import partial
from pathlib import Path

from msgspec.structs import replace

from schema.agent.flags import Flags, add_count, add_plugins, add_settings
from schema.agent.progress_line import progress_if_long
from schema.errors import counted, rounded
from schema.experiment.identity import NO_IDENTITY
from schema.experiment.settings import EvaluationSettings
from schema.formats.run_settings import read_with_settings, tell
from schema.limits import MOST_TRIAL
from schema.plugins.permission import allow
from schema.robot.results import Evaluation
from schema.robot.robot import Robot
from worker.robot.evaluation import evaluate
from worker.robot.robustness import (
    all_changes,
    rejudge,
    summary,
    window_changes,
)


def main(arguments: list[str]) -> int:
    """Simulate a robot, print its evaluation, and return the exit code, 0."""
    options = parser().parse_args(arguments[1:])
    allow(options.plugins)
    robot, settings = _read(options.file, options.experiment, options.island)
    found = _evaluate(robot, settings, options.trial)
    labels = settings.measures.labels
    for name, value, unit in (
        ("fitness", found.fitness, ""),
        ("path velocity", found.path_velocity, " m/s"),
        ("straight velocity", found.straight_velocity, " m/s"),
        ("simulated", found.simulated_s, " s"),
        *(
            (name, value, "")
            for name, value in zip(labels, found.measures, strict=True)
        ),
    ):
        # All digits, for comparisons of two runs.
        print(f"{name + ':':19}{value!r}{unit}")
    if options.robustness:
        _show_robustness(robot, settings, found.fitness, options.trial)
    return 0


def _evaluate(robot: Robot, settings: EvaluationSettings, trial: int) -> Evaluation:
    """Return the evaluation of a robot; show progress if it takes long."""
    clock = settings.simulation
    all_s = f"{clock.evaluation_steps * clock.timestep_s:g} s"
    building = f"building the model of {counted(len(robot.parts), 'part')}"
    with progress_if_long(building) as tell_progress:
        return evaluate(
            robot,
            settings,
            replace(NO_IDENTITY, trial=trial),
            watch=lambda data: tell_progress(f"simulated {data.time:.1f} of {all_s}"),
        )


def _show_robustness(
    robot: Robot, settings: EvaluationSettings, fitness: float, trial: int
) -> None:
    """Print the robot's fitness under each small change, then one line of all."""
    if settings.robust is not None:
        settings = replace(settings, robust=None)
        fitness = _evaluate(robot, settings, trial).fitness
        print(f"{'undisturbed:':26}{rounded(fitness)}")
    again = partial(_evaluate, trial=trial)
    found: list[list[float | None]] = []
    small = [change for change in all_changes(settings) if change.is_small]
    for changes in (small, window_changes(settings)):
        found.append([])
        for change, changed in rejudge(robot, changes, again):
            print(f"{change.name + ':':26}{_share(changed, fitness)}", flush=True)
            found[-1].append(changed)
    print(summary(fitness, *found))


def _share(found: float | None, fitness: float) -> str:
    if found is None:
        return "failed"
    share = f" ({100 * found / fitness:.0f} %)" if fitness > 0 else ""
    return f"{rounded(found)}{share}"


def _read(
    path: Path, experiment: str | None, island: int | None
) -> tuple[Robot, EvaluationSettings]:
    """Return a file's robot and its settings; say how its evolution differs."""
    robot, settings, found = read_with_settings(
        path, experiment, island, tells_default=True
    )
    if found is not None and found.arena is not None:
        tell(
            "simulated alone; in an arena, robots are dropped at birth, and fitness "
            "is that of a window of their life among others"
        )
    draws = (
        settings.simulation.sensor_noise,
        settings.simulation.actuator_noise,
        settings.environment.push_impulse,
        settings.robust,
    )
    if any(draws):
        tell("noise, pushes and [robust] use other random numbers than the run")
    clock = settings.simulation
    if clock.evaluation_s is not None:
        seconds = clock.evaluation_steps * clock.timestep_s
        tell(
            f"simulated for {seconds:g} s; the run draws the length of each evaluation "
            "(simulation.evaluation_s)"
        )
    return robot, settings


def parser(_command: str = "robot simulate") -> Flags:
    """Return the parser of ``revolve robot simulate``."""
    flags = Flags(
        prog="revolve robot simulate",
        description="Simulate a robot alone and evaluate it as an experiment does.",
        examples=(
            "revolve robot simulate best.yaml --experiment scenario1",
            "revolve robot simulate best.xml",
        ),
    )
    flags.add_argument(
        "file", type=Path, metavar="FILE|RUN", help="robot file, or run folder"
    )
    add_settings(
        flags,
        "those in an MJCF or a packed file, else those of the run folder that holds "
        "the file, else those of scenario1",
    )
    flags.add_argument(
        "--robustness",
        action="store_true",
        help="evaluate it again with finer time steps, 1 %% less friction, starts "
        "raised by about 0.1 mm, and in the next four windows, and show how much of "
        "its fitness it keeps",
    )
    what = "number of the evaluation, from 0: each has noise, pushes and disturbances "
    add_count(flags, "--trial", 0, f"{what}of its own", least=0, most=MOST_TRIAL)
    add_plugins(flags)
    return flags
