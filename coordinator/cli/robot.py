"""``revolve robot random``: a robot as evolution would start with."""

import argparse
import sys
from pathlib import Path

from coordinator.evolution.generation import generate
from coordinator.evolution.random_streams import Purpose, stream
from schema.experiment.document import body_space
from schema.experiment.file import read_experiment
from schema.flags import Flags, whole_number
from schema.formats.files import settings_of, write_robot
from schema.robot.genome import develop
from schema.robot.ids import BirthId


def main(arguments: list[str]) -> int:
    """Write random robots, one file each, and return the exit code.

    They have passed the experiment's restrictions, not its analyzer.

    Args:
        arguments: the command's name, ``robot random``, first.

    Returns:
        0 if all are written.

    Raises:
        ExperimentError: no such experiment, or one that allows (nearly) no robot.
        InvalidRobot: a file that cannot be written.
    """
    options = _parser().parse_args(arguments[1:])
    experiment = read_experiment(options.experiment)
    space = body_space(experiment.space)
    for number in range(options.count):
        birth = BirthId(0, number)
        rng = stream(options.seed, 0, birth, 0, Purpose.GENERATE)
        robot = develop(generate(rng, experiment, birth), space)
        path: Path = options.file
        if options.count > 1:
            path = path.with_stem(f"{path.stem}-{number}")
        write_robot(robot, path, space, settings_of(experiment))
        print(f"{path}: {len(robot.parts)} parts, {len(robot.brain.neurons)} neurons")
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = Flags(
        prog="revolve robot random",
        description="Make up a robot as an experiment makes up its founders.",
        epilog="example: revolve robot random some.yaml --seed 7 --count 3",
    )
    parser.add_argument("file", type=Path, metavar="FILE", help=".yaml, .pb, .xml, ...")
    parser.add_argument("--seed", type=whole_number(0), default=1, metavar="N")
    parser.add_argument("--count", type=whole_number(0), default=1, metavar="N")
    parser.add_argument("--experiment", default="scenario1", metavar="NAME|FILE.toml")
    return parser


if __name__ == "__main__":
    sys.exit(main(["robot random", *sys.argv[1:]]))
