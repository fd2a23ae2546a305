"""``revolve robot simulate``: the robot of a file, judged as in a run."""

import argparse
import sys
from pathlib import Path

from schema.experiment.document import body_space
from schema.experiment.file import read_experiment
from schema.experiment.settings import EvaluationSettings
from schema.flags import Flags
from schema.formats.files import MJCF_ENDING, read_robot, settings_of
from schema.formats.mjcf import read_mjcf
from schema.robot.robot import Robot
from worker.fitness import path_velocity, straight_velocity
from worker.robot.evaluation import judge, simulate


def main(arguments: list[str]) -> int:
    """Simulate a robot, print what it came to, and return the exit code.

    Args:
        arguments: the command's name, ``robot simulate``, first.

    Returns:
        0 if it was judged.

    Raises:
        InvalidRobot: a file that holds no robot.
        SimulationDiverged: the physics did.
        FitnessUndefined: there is no number for what it did.
        ExperimentError: an experiment that is none, or a sensor that it cannot feed.
    """
    options = _parser().parse_args(arguments[1:])
    robot, settings = _read(options.file, options.experiment)
    world = settings.environment
    track = simulate(robot, settings.space, settings.simulation, world)
    clock = settings.simulation
    duration_s = (clock.warmup_steps + clock.window_steps) * clock.timestep_s
    for name, value, unit in (
        ("fitness", judge(track, settings.fitness), ""),
        ("path velocity", path_velocity(track), " m/s"),
        ("straight velocity", straight_velocity(track), " m/s"),
        ("simulated", duration_s, " s"),
    ):
        # All digits: whoever compares two runs wants them.
        print(f"{name + ':':19}{value!r}{unit}")
    return 0


def _read(path: Path, experiment: str | None) -> tuple[Robot, EvaluationSettings]:
    """Return a file's robot and the settings to judge it by, the file's own first."""
    if path.suffix.lower() == MJCF_ENDING and experiment is None:
        return read_mjcf(path)
    settings = settings_of(read_experiment(experiment) if experiment else None)
    return read_robot(path, body_space(settings.space)), settings


def _parser() -> argparse.ArgumentParser:
    parser = Flags(
        prog="revolve robot simulate",
        description="Simulate a robot alone, and judge it as an experiment does.",
        epilog="example: revolve robot simulate best.yaml --experiment scenario1",
    )
    parser.add_argument("file", type=Path, metavar="FILE")
    parser.add_argument(
        "--experiment",
        metavar="NAME|FILE.toml",
        help="judge as this experiment does; by default as an MJCF file says, and any "
        "other as the thesis's off-line experiments do",
    )
    return parser


if __name__ == "__main__":
    sys.exit(main(["robot simulate", *sys.argv[1:]]))
