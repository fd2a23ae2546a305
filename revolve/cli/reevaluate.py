"""``revolve robustness`` and ``ablate``: re-evaluate robots of finished runs."""

import os
from pathlib import Path

from schema.agent.extras import extra
from schema.agent.flags import Flags, add_count, add_plugins
from schema.agent.supervisor import most_processes
from schema.plugins.permission import allow

_ABLATE = "ablate"
_DESCRIPTIONS = {
    "robustness": "Re-evaluate the last population and the best robot ever of "
    "finished runs, alone, under changes of time step, friction, start, mass, "
    "torque, noise and ground, and show how much of their fitness they keep.",
    _ABLATE: "Re-evaluate the best robot ever and the fittest of the last "
    "population of finished runs, alone: with sensors that read 0 or their mean, "
    "with dead motors, and with random brains. Show how much of their fitness they "
    "keep.",
}
_EXAMPLES = {
    "robustness": "--out robust --workers 4",
    _ABLATE: "--out without --robots 10",
}


def main(arguments: list[str]) -> int:
    """Re-evaluate robots, write table and figure, and return the exit code."""
    command, *words = arguments
    options = parser(command).parse_args(words)
    allow(options.plugins)
    # Before matplotlib is imported: it refuses backends of other programs.
    os.environ["MPLBACKEND"] = "agg"
    with extra(f"{command} needs", "analysis"):
        from revolve.cli.changes import write_results
    write_results(command, options)
    return 0


def parser(command: str) -> Flags:
    """Return the parser of ``revolve robustness`` or ``revolve ablate``."""
    flags = Flags(
        prog=f"revolve {command}",
        description=_DESCRIPTIONS[command],
        examples=(
            f"revolve {command} runs/scenario1-seed1",
            f"revolve {command} runs/a runs/b {_EXAMPLES[command]}",
        ),
    )
    flags.add_argument(
        "runs", nargs="+", type=Path, metavar="RUN", help="run folder, finished"
    )
    flags.add_argument(
        "--out",
        type=Path,
        default=Path("ablation" if command == _ABLATE else command),
        metavar="FOLDER",
        help="folder to write to (default: %(default)s)",
    )
    what = "number of workers, started on this machine; no result depends on it "
    what += "(default: one per core)"
    add_count(flags, "--workers", None, what, most=most_processes())
    add_plugins(flags)
    if command == _ABLATE:
        what = "number of robots, the fittest of the last populations"
        add_count(flags, "--robots", 5, what, least=0)
        add_count(flags, "--brains", 5, "random brains for each body", least=0)
    return flags
