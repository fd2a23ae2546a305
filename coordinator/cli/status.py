"""``revolve status``: progress of runs, from their coordinator or their folders."""

import argparse
from collections.abc import Sequence
from pathlib import Path
from uuid import uuid4

from rich.console import Console
from rich.table import Table

from coordinator.cli.format import (
    duration,
    fault_lines,
    missing_agents,
    run_details,
    silent_lines,
    state_of,
)
from coordinator.cli.status_json import Source, status_json
from coordinator.network.client_service import ask_coordinators
from coordinator.storage.campaign import CAMPAIGN, is_campaign, read_campaign
from coordinator.storage.folder import EPOCH, RunDetails, holds_run
from coordinator.storage.folder_status import folder_status, unbegun_status
from coordinator.storage.hints import command, resume_command
from coordinator.storage.journal import NAME as JOURNAL
from coordinator.storage.lock import LOCK, read_holder
from schema.agent.address import read_address
from schema.agent.command import add_connect, add_network_flags, connect_of, tls_of
from schema.agent.flags import Flags
from schema.agent.log import tell_user
from schema.errors import NetworkError, RevolveError, RunFolderError, counted
from schema.limits import printable
from schema.tables.arrow import skip_pandas
from schema.tables.description import DETAILS, check_folder
from schema.tables.segments import FINISHED, SEGMENTS
from schema.wire.codec import encode
from schema.wire.operator import (
    GetStatus,
    OperatorReply,
    OperatorRequest,
    decode_operator_reply,
)
from schema.wire.status import RunStatus, Status

_COLUMNS = ("run", "state", "births", "births/s", "best of population, arenas")
_WIDEST = 1000
"""Characters of the widest line that is not wrapped."""


def main(arguments: list[str]) -> int:
    """Show the progress of runs.

    Args:
        arguments: the command's name first.

    Returns:
        0 if done, 1 if a run is damaged or has failed.

    Raises:
        NetworkError: no coordinator answers at the address.
        RunFolderError: the folder holds no run and no campaign.
    """
    flags = parser()
    options = flags.parse_args(arguments[1:])
    skip_pandas()
    if options.folder is not None and options.connect is not None:
        flags.error("give either a folder or --connect")
    if options.folder is None:
        found = _at_hub(options)
        sources = [Source(status, name) for name, status in found.items()]
        code = 0
    else:
        folder = Path(options.folder)
        name, status = _live(folder, options) or (None, _by_folder(folder))
        sources = [Source(status, name, str(folder))]
        code = int(any(run.state in ("damaged", "failed") for run in status.runs))
    if options.json:
        print(status_json(sources))
        return code
    for source in sources:
        _show(source)
    return code


def _at_hub(options: argparse.Namespace) -> dict[str, Status]:
    """Return the status of each coordinator at an address, by its name.

    Raises:
        NetworkError: no coordinator answers; without ``--connect`` with what to do.
    """
    connect_of(options)  # an invalid address needs other advice
    try:
        return ask_status(options)
    except NetworkError as error:
        if options.connect is not None:
            raise
        raise NetworkError(
            f"{error}; of a run without a hub, name the folder (revolve status "
            "runs/NAME), or start it with --listen hub"
        ) from None


def ask_status(options: argparse.Namespace) -> dict[str, Status]:
    """Return the status of each coordinator at ``--connect``, by its name.

    Raises:
        NetworkError: no coordinator answers.
    """
    replies = ask(options, OperatorRequest(uuid4().hex, 0, GetStatus()))
    return {name: reply.status for name, reply in replies.items() if reply.status}


def ask(
    options: argparse.Namespace, request: OperatorRequest, only: str = ""
) -> dict[str, OperatorReply]:
    """Return the replies of the coordinators at ``--connect``, by their names.

    Args:
        options: options of the command line with the network's flags.
        request: request to all coordinators, or to one.
        only: name of the only coordinator to ask; "" asks all.

    Raises:
        NetworkError: no coordinator answers.
    """
    replies = ask_coordinators(
        encode(request),
        connect=connect_of(options),
        fleet=options.fleet,
        tls=tls_of(options),
        only=only,
    )
    return {name: decode_operator_reply(data) for name, data in replies.items()}


def _live(folder: Path, options: argparse.Namespace) -> tuple[str, Status] | None:
    """Return name and status of a folder's coordinator; None if none is running."""
    try:
        options.connect = read_address(folder)
        found = ask_status(options)
    except NetworkError as error:
        if read_holder(folder):
            tell_user(f"its coordinator cannot be asked: {error}")
        return None
    here = folder.resolve()
    for name, status in found.items():
        paths = [Path(run.folder) for run in status.runs]
        if any(here in (path, path.parent) for path in paths):
            return name, status
    return None


def _by_folder(folder: Path) -> Status:
    """Return the status of all runs at or below a folder, read from disk.

    Raises:
        RunFolderError: there is no run and no campaign.
    """
    check_folder(folder)
    planned: dict[Path, RunDetails] = {}
    runs: list[RunStatus] = []
    for path in _below(folder, CAMPAIGN):
        try:
            planned.update(read_campaign(path).runs(path))
        except RunFolderError as error:
            runs.append(_damaged(path, error))
    others = [path for path in _below(folder, DETAILS) if path not in planned]
    for path in (*planned, *filter(_is_ours, others)):
        try:
            is_begun = path not in planned or holds_run(path)
            runs.append(
                folder_status(path) if is_begun else unbegun_status(path, planned[path])
            )
        except RevolveError as error:
            runs.append(_damaged(path, error))
    if not runs:
        raise RunFolderError(
            f"{folder}: no run and no campaign in this folder or below"
        )
    return Status(tuple(runs), 0, 0, 0.0)


def _below(folder: Path, name: str) -> list[Path]:
    """Return the folders at any depth that hold a file of a name.

    Symbolic links are followed one level deep only: deeper ones may form a cycle.
    """
    found = {*folder.glob(f"**/{name}"), *folder.glob(f"*/{name}")}
    return sorted(path.parent for path in found)


def _is_ours(folder: Path) -> bool:
    """Return whether a folder with a ``run.json`` has any other file of a run."""
    names = (LOCK, EPOCH, JOURNAL, SEGMENTS, FINISHED)
    return any((folder / name).exists() for name in names)


def _damaged(folder: Path, error: RevolveError) -> RunStatus:
    """Report what is wrong with a folder; return a status without any counts."""
    tell_user(f"damaged: {error}")
    return RunStatus(str(folder.resolve()), folder.name, 0, "damaged")


def _show(source: Source) -> None:
    """Print the progress of runs, named by path below the folder or folder name."""
    status, is_live = source.status, source.coordinator is not None
    root = Path(source.folder) if source.folder else None
    above = root and root.resolve()
    rows = []
    for run in status.runs:
        folder = Path(run.folder)
        if above and above in folder.parents:
            name = str(folder.relative_to(above))
        else:
            name = folder.name
        rows.append(
            (
                name,
                state_of(run, status, is_live=is_live),
                f"{run.births} of {run.wanted}" if run.islands else "",
                f"{run.births_per_s:.1f}" if run.births_per_s else "",
                run_details(run) if run.islands else "",
            )
        )
    done = sum(run.state == "finished" for run in status.runs)
    births = f"{status.births} of {counted(status.wanted, 'birth')}"
    runs = counted(len(status.runs), "run")
    lines = [
        source.folder or source.coordinator or "",
        f"{done} of {runs} finished, {births}",
    ]
    if status.workers or status.analyzers:
        lines.append(
            f"{status.births_per_s:.1f} births/s, {counted(status.workers, 'worker')}, "
            f"{counted(status.analyzers, 'analyzer')}, {duration(status.left_s)} left"
        )
    elif done < len(status.runs) and root is not None and not is_live:
        lines.append(_without_coordinator(status, root))
    elif done < len(status.runs):
        lines.append(f"waiting for {' and '.join(missing_agents(status))}")
    about = (*silent_lines(status.silent), *fault_lines(status.faults))
    lines += [printable(line, _WIDEST) for line in about]
    # Wide: a narrow terminal wraps lines, but none is cut.
    console = Console(width=_WIDEST, highlight=False, markup=False)
    for line in lines:
        console.print(line)
    console.print(_table(rows))


def _table(rows: Sequence[Sequence[str]]) -> Table:
    """Return a table of runs without the columns that are empty in all rows."""
    table = Table(box=None)
    columns = dict(zip(_COLUMNS, zip(*rows, strict=True), strict=False))
    shown = {name: cells for name, cells in columns.items() if any(cells)}
    for name in shown:
        table.add_column(name)
    for row in zip(*shown.values(), strict=True):
        table.add_row(*row)
    return table


def _without_coordinator(status: Status, root: Path) -> str:
    """Return a line about unfinished runs whose coordinator does not report them."""
    running = [Path(run.folder) for run in status.runs if run.state == "running"]
    if is_campaign(root) or holds_run(root):
        if running:
            return "the coordinator does not answer"
        return (
            "no coordinator is running; the newest births are perhaps in the journal "
            f"only, and are kept; to continue: {resume_command(root)}"
        )
    if not running:
        return "no coordinator is running"
    # Each coordinator has a folder of its own: that of its campaign or its run.
    first, above = running[0], running[0].parent
    where = _from(root, above if is_campaign(above) else first)
    return f"from the files; to ask a coordinator: {command('status', where)}"


def _from(root: Path, folder: Path) -> Path:
    """Return an absolute path by way of a folder that may be relative."""
    above = root.resolve()
    is_below = folder.is_relative_to(above)
    return root / folder.relative_to(above) if is_below else folder


def parser(_command: str = "status") -> Flags:
    """Return the parser of ``revolve status``."""
    flags = Flags(
        prog="revolve status",
        description="Show the progress of a run, a campaign or all runs of a fleet.",
        examples=(
            "revolve status    # all coordinators at this user's hub",
            "revolve status runs",
            "revolve status runs/thesis-seed1 --json",
        ),
    )
    flags.add_argument(
        "folder",
        nargs="?",
        metavar="FOLDER",
        help="run or campaign folder, or a folder that contains some (default: all "
        "coordinators at the hub)",
    )
    flags.add_argument(
        "--json", action="store_true", help="print JSON, one document for programs"
    )
    add_connect(flags)
    add_network_flags(flags)
    return flags
