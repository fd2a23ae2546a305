"""``revolve robot random``: random robots as evolution starts with."""

from pathlib import Path

from analyzer.report import analyze
from coordinator.evolution.newborns import founder
from schema.agent.flags import Flags, add_count, add_seed
from schema.errors import counted
from schema.experiment.document import body_space
from schema.experiment.file import read_experiment
from schema.formats.files import settings_of, write_robot
from schema.robot.robot import Robot


def main(arguments: list[str]) -> int:
    """Write random robots, one file each, and return the exit code.

    They are the founders, vetted, of the experiment's first run with the seed.
    """
    options = parser().parse_args(arguments[1:])
    experiment = read_experiment(options.experiment)
    space, vetting = body_space(experiment.space), experiment.vetting

    def why_not(robot: Robot, _attempt: int) -> str:
        return "" if options.unvetted else analyze(robot, space, vetting).reason

    for number in range(options.count):
        robot = founder(experiment, options.seed, number, why_not)
        path: Path = options.file
        if options.count > 1:
            path = path.with_stem(f"{path.stem}-{number}")
        write_robot(robot, path, settings_of(experiment))
        parts = counted(len(robot.parts), "part")
        print(f"{path}: {parts}, {counted(len(robot.brain.neurons), 'neuron')}")
    return 0


def parser(_command: str = "robot random") -> Flags:
    """Return the parser of ``revolve robot random``."""
    flags = Flags(
        prog="revolve robot random",
        description="Generate random robots as an experiment generates its founders.",
        examples=(
            "revolve robot random some.yaml --seed 7 --count 3",
            "revolve robot random light.xml --experiment light",
        ),
    )
    flags.add_argument(
        "file",
        type=Path,
        metavar="FILE",
        help="robot file, to be written: .yaml, .pb, .xml, ...",
    )
    add_seed(flags, default=1)
    add_count(flags, "--count", 1, "number of robots")
    flags.add_argument(
        "--unvetted",
        action="store_true",
        help="also robots whose parts intersect, which evolution refuses",
    )
    flags.add_argument(
        "--experiment",
        default="scenario1",
        metavar="NAME|FILE.toml",
        help="experiment whose settings to use (default: %(default)s)",
    )
    return flags
