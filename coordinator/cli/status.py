"""``revolve status``: progress of runs, from their coordinator or their folders."""

import argparse
import json
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import NamedTuple
from uuid import uuid4

from msgspec import to_builtins

from coordinator.cli.status_text import (
    births_done,
    group_lines,
    missing_agents,
    pace,
    part_lines,
    run_table,
    runs_done,
    show,
    time_left,
    trouble_lines,
    waiting_text,
)
from coordinator.network.client_service import asking
from coordinator.storage.campaign import is_campaign
from coordinator.storage.folder import holds_run
from coordinator.storage.folder_status import status_below
from coordinator.storage.hints import command, resume_command
from coordinator.storage.lock import read_holder
from schema.agent.address import read_address
from schema.agent.command import NETWORK, add_shared, connect_of, tls_of
from schema.agent.flags import Flags
from schema.agent.log import tell_user
from schema.errors import NetworkError, RunFolderError, counted
from schema.tables.arrow import skip_pandas
from schema.tables.description import groups_of
from schema.wire.codec import encode
from schema.wire.operator import (
    GetStatus,
    OperatorReply,
    OperatorRequest,
    decode_operator_reply,
)
from schema.wire.status import RunStatus, Status, joined

VERSION = 1
"""Of the JSON document; it changes when a key changes its meaning or is removed."""
_SUMS = ("births", "wanted", "left_s")
"""Keys of the document that follow from others."""


class Source(NamedTuple):
    """A status, and the coordinator that reported it or the folder that shows it."""

    status: Status
    coordinator: str | None = None
    folder: str | None = None


def main(arguments: list[str]) -> int:
    """Show the progress of runs; return 1 if one is damaged or has failed, else 0."""
    flags = parser()
    options = flags.parse_args(arguments[1:])
    skip_pandas()
    if options.folder is not None and options.connect is not None:
        flags.error("give either a folder or --connect")
    if options.folder is None:
        sources = [Source(status, name) for name, status in _at_hub(options).items()]
        code = 0
    else:
        folder = Path(options.folder)
        name, status = _live(folder, options) or (None, status_below(folder))
        sources = [Source(status, name, str(folder))]
        code = int(any(run.state in ("damaged", "failed") for run in status.runs))
    if options.json:
        print(status_json(sources))
        return code
    for source in sources:
        show_source(source)
    return code


def _at_hub(options: argparse.Namespace) -> dict[str, Status]:
    """Return the status of each coordinator at an address, by its name."""
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
    """Return the status of each coordinator at ``--connect``, by name, as ``ask``."""
    replies = ask(options, OperatorRequest(uuid4().hex, 0, GetStatus()))
    return {name: reply.status for name, reply in replies.items() if reply.status}


def ask(
    options: argparse.Namespace, request: OperatorRequest, only: str = ""
) -> dict[str, OperatorReply]:
    """Return the replies of all coordinators, or of the only one, by their names.

    Raises:
        NetworkError: no coordinator answers.
    """
    hub, tls = connect_of(options), tls_of(options)
    with asking(hub, fleet=options.fleet, tls=tls, only=only) as replies_to:
        replies = replies_to(encode(request))
    return {name: decode_operator_reply(data) for name, data in replies.items()}


def _live(folder: Path, options: argparse.Namespace) -> tuple[str, Status] | None:
    """Return name and status of a folder's coordinators, joined; None without any."""
    try:
        options.connect = read_address(folder)
        statuses = ask_status(options)
    except NetworkError as error:
        if read_holder(folder):
            tell_user(f"its coordinator cannot be asked: {error}")
        return None
    here = folder.resolve()
    own = {
        name: status
        for name, status in statuses.items()
        if any(here in (path := Path(run.folder), path.parent) for run in status.runs)
    }
    return (", ".join(own), joined([*own.values()])) if own else None


def status_json(sources: Sequence[Source]) -> str:
    """Return the JSON document of all sources; docs/machines.md describes its keys."""

    def facts(shown: Status | RunStatus) -> dict[str, object]:
        sums = {key: getattr(shown, key) for key in _SUMS}
        return {**sums, **to_builtins(shown)}

    coordinators = [
        {
            "name": source.coordinator,
            "folder": source.folder,
            **facts(source.status),
            "runs": [facts(run) for run in source.status.runs],
        }
        for source in sources
    ]
    document = {"version": VERSION, "coordinators": coordinators}
    return json.dumps(document, indent=2, allow_nan=False)


def show_source(source: Source) -> None:
    """Print the progress of runs, named by path below the folder or folder name."""
    status, is_live = source.status, source.coordinator is not None
    root = Path(source.folder) if source.folder else None
    above = root and root.resolve()

    def name_of(run: RunStatus) -> str:
        folder = Path(run.folder)
        if above and above in folder.parents:
            return str(folder.relative_to(above))
        return folder.name

    lines = [
        source.folder or source.coordinator or "",
        f"{runs_done(status)} finished, {births_done(status)}",
    ]
    if status.workers or status.analyzers:
        analyzers = counted(status.analyzers, "analyzer")
        lines.append(f"{pace(status)}, {analyzers}, {time_left(status)}")
    elif any(run.state != "finished" for run in status.runs):
        if root is not None and not is_live:
            lines.append(_without_coordinator(status, root))
        else:
            lines.append(waiting_text(missing_agents(status)))
    table = run_table(status, name_of, is_live=is_live)
    groups = [line for run in status.runs for line in group_lines(run)]
    show(*lines, *part_lines(status), *groups, *trouble_lines(status), table)


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
        with suppress(RunFolderError):  # other groups are on other machines
            if groups_of(root):
                return f"no coordinator is running; to continue: {resume_command(root)}"
        return "no coordinator is running"
    # Each coordinator has a folder of its own: that of its campaign or its run.
    first, above = running[0], running[0].parent
    where, here = above if is_campaign(above) else first, root.resolve()
    if where.is_relative_to(here):
        where = root / where.relative_to(here)
    return f"from the files; to ask a coordinator: {command('status', where)}"


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
    add_shared(flags, "--connect", *NETWORK)
    return flags
