"""``revolve robot random``: random robots as evolution starts with."""

from pathlib import Path

from analyzer.report import analyze
from coordinator.evolution.breeding import Breeder
from schema.agent.flags import Flags, add_count, add_seed
from schema.errors import counted
from schema.experiment.document import body_space
from schema.experiment.file import read_experiment
from schema.formats.files import settings_of, write_robot
from schema.robot.ids import BirthId


def main(arguments: list[str]) -> int:
    """Write random robots, one file each, and return the exit code.

    They are the founders, vetted, of the experiment's first run with the seed.
    """
    options = parser().parse_args(arguments[1:])
    experiment = read_experiment(options.experiment)
    breeder = Breeder(experiment, options.seed, run=0)
    space, vetting = body_space(experiment.space), experiment.vetting
    for number in range(options.count):
        attempt, why, is_done = 0, "", False
        while not is_done:
            candidate = breeder.candidate(BirthId(0, number), attempt, (), why=why)
            assert candidate is not None
            attempt, robot = candidate.attempt + 1, candidate.robot
            why = analyze(robot, space, vetting).reason
            is_done = options.unvetted or not why
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
