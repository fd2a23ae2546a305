"""Command ``revolve join``: one run of the groups of islands of an archipelago."""

from pathlib import Path

from coordinator.cli.summary import conclude
from coordinator.storage.folder import read_details
from coordinator.storage.joining import join_groups
from schema.agent.flags import Flags
from schema.experiment.file import experiment_from_text
from schema.tables.arrow import skip_pandas


def parser(_command: str = "join") -> Flags:
    """Return the parser of the command's arguments."""
    flags = Flags(
        prog="revolve join",
        description=(
            "Make one run of the finished groups of islands of an archipelago. "
            "Commands that read runs do not need it: they take the folder that holds "
            "all groups as one run."
        ),
        examples=(
            "revolve join runs/a --out runs/whole",
            "revolve join runs/a/group-0 elsewhere/group-1 --out runs/whole",
        ),
    )
    about = "folder of a group, or the one that holds all groups"
    flags.add_argument("groups", metavar="GROUP", nargs="+", help=about)
    flags.add_argument(
        "--out", metavar="FOLDER", required=True, help="folder to write to"
    )
    return flags


def main(arguments: list[str]) -> int:
    """Join groups, show the result, and return the exit code."""
    options = parser().parse_args(arguments[1:])
    skip_pandas()
    out = Path(options.out)
    join_groups([*map(Path, options.groups)], out)
    document = read_details(out).document
    print(conclude(out, experiment_from_text(document, is_own=True)).text)
    return 0
