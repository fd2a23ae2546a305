"""``revolve robot check``: vet the robot of a file as an analyzer does."""

from pathlib import Path

from analyzer.report import analyze
from schema.agent.flags import Flags, add_plugins, add_settings
from schema.experiment.document import Vetting
from schema.formats.files import types_for
from schema.formats.run_settings import read_with_settings
from schema.plugins.permission import allow
from schema.robot.robot import size_text


def main(arguments: list[str]) -> int:
    """Print whether a robot is well formed and viable, and return the exit code.

    Args:
        arguments: the command's name, ``robot check``, first.

    Returns:
        0 if it is well formed, viable or not.

    Raises:
        RevolveError: the file holds no well-formed robot, or cannot be read.
    """
    options = parser().parse_args(arguments[1:])
    allow(options.plugins)
    robot, settings, experiment = read_with_settings(
        options.file, options.experiment, options.island
    )
    space, _ = types_for(settings)
    report = analyze(robot, space, experiment.vetting if experiment else Vetting())
    verdict = f"not viable: {report.reason}" if report.reason else "viable"
    print(f"{options.file}: well formed; {size_text(robot)}; {verdict}")
    return 0


def parser(_command: str = "robot check") -> Flags:
    """Return the parser of ``revolve robot check``."""
    flags = Flags(
        prog="revolve robot check",
        description="Check that a file holds a well-formed robot, and say whether "
        "evolution accepts its body: no two parts intersect, and one has a motor.",
        examples=(
            "revolve robot check best.yaml",
            "revolve robot check wheeled.yaml --experiment mine.toml",
        ),
    )
    flags.add_argument("file", type=Path, metavar="FILE", help="robot file")
    add_settings(
        flags,
        "that in an MJCF file, else that of the run folder that holds the file, else "
        "all built-in part types and the default vetting",
    )
    add_plugins(flags)
    return flags
