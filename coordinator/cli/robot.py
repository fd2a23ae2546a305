"""``revolve robot random``: random robots as evolution starts with."""

import argparse
import sys
from pathlib import Path

from coordinator.evolution.breeding import Breeder
from schema.agent.flags import Flags, add_count
from schema.experiment.brains import neuron_kinds
from schema.experiment.document import body_space
from schema.experiment.file import read_experiment
from schema.formats.files import settings_of, write_robot
from schema.robot.ids import BirthId


def main(arguments: list[str]) -> int:
    """Write random robots, one file each, and return the exit code.

    They meet the experiment's restrictions; no analyzer vets them.

    Args:
        arguments: the command's name, ``robot random``, first.

    Returns:
        0 once all files are written.

    Raises:
        ExperimentError: no such experiment, or it allows (nearly) no robot.
        InvalidRobot: a file cannot be written.
    """
    options = _parser().parse_args(arguments[1:])
    experiment = read_experiment(options.experiment)
    breeder = Breeder(experiment, options.seed, run=0)
    space = body_space(experiment.space)
    kinds = neuron_kinds(experiment.brain, experiment.space)
    for number in range(options.count):
        candidate = breeder.candidate(BirthId(0, number), 0, ())
        assert candidate is not None
        robot = candidate.robot
        path: Path = options.file
        if options.count > 1:
            path = path.with_stem(f"{path.stem}-{number}")
        write_robot(robot, path, space, settings_of(experiment), kinds)
        print(f"{path}: {len(robot.parts)} parts, {len(robot.brain.neurons)} neurons")
    return 0


def _parser() -> argparse.ArgumentParser:
    parser = Flags(
        prog="revolve robot random",
        description="Generate random robots as an experiment generates its founders.",
        epilog="example: revolve robot random some.yaml --seed 7 --count 3",
    )
    parser.add_argument(
        "file", type=Path, metavar="FILE", help="output: .yaml, .pb, .xml, ..."
    )
    add_count(parser, "--seed", 1, "random seed", least=0)
    add_count(parser, "--count", 1, "number of robots", least=0)
    parser.add_argument(
        "--experiment",
        default="scenario1",
        metavar="NAME|FILE.toml",
        help="experiment whose settings to use (default: %(default)s)",
    )
    return parser


if __name__ == "__main__":
    sys.exit(main(["robot random", *sys.argv[1:]]))
