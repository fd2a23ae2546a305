"""``revolve status``: how far runs are, told by who is at them or by their folders."""

import argparse
from pathlib import Path
from uuid import uuid4

from rich.console import Console
from rich.table import Table

from coordinator.campaign import is_campaign, read_campaign
from coordinator.client_service import ask_coordinators
from coordinator.folder import DETAILS
from coordinator.folder_status import folder_status, unbegun_status
from coordinator.running import ADDRESS
from coordinator.wording import about_arenas, best_of, duration
from schema.agent_command import add_network_flags, tls_of
from schema.errors import NetworkError, RunFolderError
from schema.flags import Flags
from schema.operator_codec import (
    OperatorRequest,
    StatusWish,
    decode_operator_reply,
    encode_operator_request,
)
from schema.status import Status


def main(arguments: list[str]) -> int:
    """Tell how far runs are.

    Args:
        arguments: the command's name first.

    Returns:
        0 if done.

    Raises:
        NetworkError: no coordinator answers at an address that was given.
        RunFolderError: no run or campaign is in a folder that was given.
    """
    flags = _flags()
    options = flags.parse_args(arguments[1:])
    if (options.folder is None) == (options.connect is None):
        flags.error("give either a folder or --connect")
    if options.connect is not None:
        for name, status in ask_status(options).items():
            _show(status, name)
        return 0
    folder = Path(options.folder)
    live = _live(folder, options)
    _show(live or _by_folder(folder), str(folder))
    return 0


def ask_status(options: argparse.Namespace) -> dict[str, Status]:
    """Return how far the runs of each coordinator at ``--connect`` are.

    Raises:
        NetworkError: none answers.
    """
    told = ask_coordinators(
        encode_operator_request(OperatorRequest(uuid4().hex, 0, StatusWish())),
        connect=options.connect,
        fleet=options.fleet,
        tls=tls_of(options),
    )
    replies = {name: decode_operator_reply(data) for name, data in told.items()}
    return {name: reply.status for name, reply in replies.items() if reply.status}


def _live(folder: Path, options: argparse.Namespace) -> Status | None:
    """Return what a folder's coordinator tells, None if it has none."""
    try:
        options.connect = (folder / ADDRESS).read_text(encoding="utf-8").strip()
        told = ask_status(options)
    except (OSError, NetworkError):
        return None
    here = folder.resolve()
    for status in told.values():
        places = [Path(run.folder) for run in status.runs]
        if any(here in (place, place.parent) for place in places):
            return status
    return None


def _by_folder(folder: Path) -> Status:
    """Return how far the runs of a folder are by what stands on disk.

    Raises:
        RunFolderError: no run and no campaign is there.
    """
    if is_campaign(folder):
        runs = tuple(
            folder_status(path)
            if (path / DETAILS).exists()
            else unbegun_status(path, details)
            for path, details in read_campaign(folder).runs(folder)
        )
    elif (folder / DETAILS).exists():
        runs = (folder_status(folder),)
    else:
        places = sorted(path.parent for path in folder.glob(f"*/{DETAILS}"))
        runs = tuple(map(folder_status, places))
    if not runs:
        raise RunFolderError(f"{folder}: no run and no campaign is there")
    return Status(runs, 0, 0, 0.0)


def _show(status: Status, title: str) -> None:
    table = Table("run", "state", "births", "births/s", "best, arenas", box=None)
    for run in status.runs:
        table.add_row(
            Path(run.folder).name,
            run.state,
            f"{run.births} of {run.wanted}",
            f"{run.births_per_s:.1f}" if run.state == "running" else "",
            f"{best_of(run)}{about_arenas(run)}",
        )
    done = sum(run.state == "finished" for run in status.runs)
    births = f"{status.births} of {status.wanted} births"
    lines = [title, f"{done} of {len(status.runs)} runs finished, {births}"]
    if status.workers or status.analyzers:
        lines.append(
            f"{status.births_per_s:.1f} births/s, {status.workers} workers, "
            f"{status.analyzers} analyzers, {duration(status.left_s)} left"
        )
    else:
        lines.append("nobody is at it, or nobody works for it")
    console = Console(soft_wrap=True, highlight=False, markup=False)
    for line in lines:
        console.print(line)
    console.print(table)


def _flags() -> Flags:
    flags = Flags(
        prog="revolve status",
        description="Tell how far a run, a campaign or all runs of a fleet are.",
        epilog="for example: revolve status runs/thesis-seed1",
        allow_abbrev=False,
    )
    flags.add_argument(
        "folder", nargs="?", help="of a run or campaign, or one that has such in it"
    )
    flags.add_argument(
        "--connect", metavar="ADDRESS", help="the hub of whoever is to be asked"
    )
    add_network_flags(flags)
    return flags
