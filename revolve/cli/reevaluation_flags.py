"""Flags of the commands that evaluate robots of finished runs again."""

from pathlib import Path

from schema.agent.flags import Flags, add_plugins, whole_number
from schema.agent.supervisor import cores, most_processes


def add_reevaluation(flags: Flags, out: str) -> None:
    """Add runs, output folder, workers and plug-ins.

    Args:
        flags: of the command.
        out: default output folder.
    """
    flags.add_argument(
        "runs", nargs="+", type=Path, metavar="RUN", help="run folder, finished"
    )
    flags.add_argument(
        "--out",
        type=Path,
        default=Path(out),
        metavar="FOLDER",
        help=f"folder to write to (default: {out})",
    )
    flags.add_argument(
        "--workers",
        type=whole_number(1, most_processes()),
        default=cores(),
        metavar="N",
        help="number of workers, started on this machine; no result depends on it "
        "(default: one per core)",
    )
    add_plugins(flags)
