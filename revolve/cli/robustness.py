"""``revolve robustness``: re-evaluate the robots of finished runs under changes."""

from analysis.extras import extra
from revolve.cli.reevaluation_flags import add_reevaluation
from schema.agent.flags import Flags
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
    with extra("robustness needs", "analysis"):
        from revolve.cli.rejudging import rejudge_runs
    rejudge_runs(options.runs, options.out, options.workers)
    return 0


def parser(_command: str = "robustness") -> Flags:
    """Return the parser of ``revolve robustness``."""
    flags = Flags(
        prog="revolve robustness",
        description="Re-evaluate the last population and the best robot ever of "
        "finished runs, alone, under changes of time step, friction, start, mass, "
        "torque, noise and ground, and show how much of their fitness they keep.",
        examples=(
            "revolve robustness runs/scenario1-seed1",
            "revolve robustness runs/a runs/b --out robust --workers 4",
        ),
    )
    add_reevaluation(flags, "robustness")
    return flags
