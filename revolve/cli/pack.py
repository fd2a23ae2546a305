"""``revolve robot pack``: a robot, and all that its evaluation needs, as one file."""

from argparse import Namespace
from pathlib import Path

from analysis.viewer.flags import BEST, selected
from revolve.robot import Robot
from revolve.runs import Run
from schema.agent.flags import Flags, add_plugins
from schema.errors import InvalidRobot, RevolveError, RunFolderError
from schema.plugins.permission import allow
from schema.robot.archive import PACKED
from schema.robot.ids import BirthId


def main(arguments: list[str]) -> int:
    """Write a packed robot, and return the exit code."""
    options = parser().parse_args(arguments[1:])
    allow(options.plugins)
    out: Path = options.output
    if out.suffix.lower() != PACKED:
        raise InvalidRobot(f"{out}: must end in {PACKED}, got {out.suffix!r}")
    robot = _chosen(options)
    robot.write(out)
    print(f"{out}: written")
    return 0


def _chosen(options: Namespace) -> Robot:
    source, name = options.source, options.robot or BEST
    if options.experiment if source.is_dir() else options.robot:
        raise RevolveError(f"{source}: --robot is for a run, --experiment for a file")
    if not source.is_dir():
        return Robot.read(source, options.experiment)
    run = Run(source)
    if isinstance(name, BirthId):
        return run.robot(name.number, name.island)
    for robot in run.best() if name == BEST else run.best_ever():
        return robot
    raise RunFolderError(f"{source}: --robot {name}: no robot has a fitness yet")


def parser(_command: str = "robot pack") -> Flags:
    """Return the parser of ``revolve robot pack``."""
    flags = Flags(
        prog="revolve robot pack",
        description="Write a robot to one file, with its settings, the sources of its "
        "plug-ins, its picture, and its birth and fitness in the run.",
        examples=(
            "revolve robot pack runs/scenario1-seed1 best.robot",
            "revolve robot pack walker.yaml walker.robot --experiment scenario1",
        ),
    )
    flags.add_argument(
        "source", type=Path, metavar="FILE|RUN", help="robot file, or run folder"
    )
    flags.add_argument("output", type=Path, metavar="OUT.robot", help="file to write")
    flags.add_argument(
        "--robot", type=selected, metavar="best|best-ever|ISLAND:BIRTH",
        help="robot of a run (default: best, of its last population)",
    )  # fmt: skip
    flags.add_argument(
        "--experiment", metavar="NAME|FILE.toml",
        help="experiment whose settings to use, of a file (default: as of simulate)",
    )  # fmt: skip
    add_plugins(flags)
    return flags
