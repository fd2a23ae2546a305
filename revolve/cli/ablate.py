"""``revolve ablate``: re-evaluate robots without some sensors and motors."""

from analysis.extras import extra
from revolve.cli.reevaluation_flags import add_reevaluation
from schema.agent.flags import Flags, add_count
from schema.plugins.permission import allow


def main(arguments: list[str]) -> int:
    """Re-evaluate robots, write table and figure, and return the exit code.

    Args:
        arguments: the command's name first.

    Raises:
        RunFolderError: no run, an unfinished one, or a folder that cannot be written.
        MissingExtra: a library is not installed.
        RevolveError: no worker is left.
    """
    options = parser().parse_args(arguments[1:])
    allow(options.plugins)
    with extra("ablate needs", "analysis"):
        from revolve.cli.ablating import ablate_runs
    ablate_runs(
        options.runs,
        options.out,
        robots=options.robots,
        brains=options.brains,
        workers=options.workers,
    )
    return 0


def parser(_command: str = "ablate") -> Flags:
    """Return the parser of ``revolve ablate``."""
    flags = Flags(
        prog="revolve ablate",
        description="Re-evaluate the best robot ever and the fittest of the last "
        "population of finished runs, alone: with sensors that read 0 or their mean, "
        "with dead motors, and with random brains. Show how much of their fitness they "
        "keep.",
        examples=(
            "revolve ablate runs/scenario1-seed1",
            "revolve ablate runs/a runs/b --out without --robots 10",
        ),
    )
    add_reevaluation(flags, "ablation")
    add_count(
        flags,
        "--robots",
        5,
        "number of robots, the fittest of the last populations",
        least=0,
    )
    add_count(flags, "--brains", 5, "random brains for each body", least=0)
    return flags
