"""``revolve status``: how far runs are, told by who is at them or by their folders."""

import argparse
from pathlib import Path
from uuid import uuid4

from rich.console import Console
from rich.table import Table

from coordinator.cli.execute import ADDRESS
from coordinator.cli.format import about_arenas, best_of, duration
from coordinator.network.client_service import ask_coordinators
from coordinator.storage.campaign import CAMPAIGN, read_campaign
from coordinator.storage.folder import DETAILS, EPOCH, RunDetails, holds_run
from coordinator.storage.folder_status import folder_status, unbegun_status
from coordinator.storage.journal import NAME as JOURNAL
from coordinator.storage.lock import LOCK
from schema.agent.command import add_network_flags, tls_of
from schema.agent.service import tell_user
from schema.errors import NetworkError, RevolveError, RunFolderError
from schema.flags import Flags
from schema.tables.files import FINISHED, SEGMENTS
from schema.wire.operator import (
    OperatorRequest,
    StatusWish,
    decode_operator_reply,
    encode_operator_request,
)
from schema.wire.status import RunStatus, Status

_WIDEST = 1000
"""Characters of a line; it ends where its text does."""


def main(arguments: list[str]) -> int:
    """Tell how far runs are.

    Args:
        arguments: the command's name first.

    Returns:
        0 if done, 1 if a run is damaged or has failed.

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
    status = _live(folder, options) or _by_folder(folder)
    _show(status, str(folder), folder)
    return 1 if any(run.state in ("damaged", "failed") for run in status.runs) else 0


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
    """Return how far the runs at or below a folder are by what stands on disk.

    Raises:
        RunFolderError: no run and no campaign is there.
    """
    planned: dict[Path, RunDetails] = {}
    runs: list[RunStatus] = []
    for place in _below(folder, CAMPAIGN):
        try:
            planned.update(read_campaign(place).runs(place))
        except RunFolderError as error:
            runs.append(_damaged(place, error))
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
        raise RunFolderError(f"{folder}: no run and no campaign is there or below")
    return Status(tuple(runs), 0, 0, 0.0)


def _below(folder: Path, name: str) -> list[Path]:
    """Return folders that hold a file of a name, at any depth; links are followed once.

    Deeper ones are not, for they may lead back.
    """
    found = {*folder.glob(f"**/{name}"), *folder.glob(f"*/{name}")}
    return sorted(path.parent for path in found)


def _is_ours(folder: Path) -> bool:
    """Return whether a folder with a description has anything else of a run."""
    names = (LOCK, EPOCH, JOURNAL, SEGMENTS, FINISHED)
    return any((folder / name).exists() for name in names)


def _damaged(folder: Path, error: RevolveError) -> RunStatus:
    """Say what is wrong with a folder; nothing else is known of it."""
    tell_user(f"damaged: {error}")
    return RunStatus(str(folder.resolve()), folder.name, 0, "damaged")


def _show(status: Status, title: str, root: Path | None = None) -> None:
    """Print how far runs are, each by its path below ``root`` or its folder's name."""
    table = Table("run", "state", "births", "births/s", "best alive, arenas", box=None)
    above = root and root.resolve()
    for run in status.runs:
        folder = Path(run.folder)
        what = f"{best_of(run)}{about_arenas(run)}"
        if above and above in folder.parents:
            name = str(folder.relative_to(above))
        else:
            name = folder.name
        table.add_row(
            name,
            run.state,
            f"{run.births} of {run.wanted}" if run.islands else "",
            f"{run.births_per_s:.1f}" if run.births_per_s else "",
            what if run.islands else "",
        )
    done = sum(run.state == "finished" for run in status.runs)
    births = f"{status.births} of {status.wanted} births"
    lines = [title, f"{done} of {len(status.runs)} runs finished, {births}"]
    if status.workers or status.analyzers:
        lines.append(
            f"{status.births_per_s:.1f} births/s, {status.workers} workers, "
            f"{status.analyzers} analyzers, {duration(status.left_s)} left"
        )
    elif done < len(status.runs):
        lines.append("nobody is at it, or nobody works for it")
    # As wide as it takes: a narrow terminal wraps lines, and nothing is cut.
    console = Console(width=_WIDEST, highlight=False, markup=False)
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
