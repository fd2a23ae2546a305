"""``revolve log``: the journal of a run as text, one line per event."""

import json
import sys
import time
from collections.abc import Iterator
from pathlib import Path

from coordinator.cli.log_lines import HEADER, EventFilter, describe, line
from coordinator.islands.events import JournalledEvent
from coordinator.storage.campaign import is_campaign
from coordinator.storage.folder import holds_run
from coordinator.storage.journal import (
    MAGIC,
    NAME,
    Position,
    check_gap,
    decode_record,
    is_empty,
    read_records,
)
from schema.agent.flags import Flags, add_count, birth_name
from schema.agent.log import tell_user
from schema.errors import RunFolderError, unreadable
from schema.tables.description import check_folder, read_state

POLL_S = 0.5
"""Time between two looks at a journal that is followed [s]."""


def main(arguments: list[str]) -> int:
    """Print the events of a run's journal; only read its files.

    Returns:
        0 if all events are printed, 1 if the journal is damaged behind them, or has
        none of the birth or island that the flags name.
    """
    options = parser().parse_args(arguments[1:])
    selection = EventFilter(options.island, *options.birth)
    path = _journal_of(options.folder, is_followed=options.follow)
    if not options.json:
        print(HEADER, flush=True)
    is_found = False
    try:
        for record, event in _events(path, is_followed=options.follow):
            for fields in describe(event, selection):
                is_found = True
                row = {"record": record, **fields}
                print(json.dumps(row) if options.json else line(row))
    except RunFolderError as error:
        sys.stdout.flush()
        print(f"revolve: {error}", file=sys.stderr)
        return 1
    if not is_found and selection != EventFilter():
        sys.stdout.flush()
        tell_user(f"{path}: has no event of that birth or island")
        return 1
    return 0


def _journal_of(folder: Path, *, is_followed: bool) -> Path:
    """Return the path of a run's journal."""
    path = folder / NAME
    check_folder(folder)
    if path.exists() or (is_followed and holds_run(folder)):
        return path
    if is_campaign(folder):
        runs = [str(each.parent) for each in sorted(folder.glob(f"*/{NAME}"))]
        such = f", such as {runs[0]}" if runs else ""
        raise RunFolderError(f"{folder}: is a campaign; give one of its runs{such}")
    what = "the run has no journal" if holds_run(folder) else "no run is there"
    raise RunFolderError(f"{folder}: {what} ({NAME} is missing)")


def _events(path: Path, *, is_followed: bool) -> Iterator[tuple[int, JournalledEvent]]:
    """Yield record number and event of all records that are not void."""
    position = Position()
    is_last = False
    while not is_last:
        # The state first: no record follows it once it says "finished".
        is_last = not is_followed or read_state(path.parent) == "finished"
        start, first = position.end, position.records
        data = _read(path, start, is_followed=is_followed)
        payloads: list[bytes] = []
        for record, payload in read_records(data, position, start):
            if record < first:
                _warn(
                    f"{path}: records from {record} on are void: another coordinator "
                    "has taken over the run"
                )
                first = record
            del payloads[record - first :]  # void records
            payloads.append(payload)
        for record, payload in enumerate(payloads, start=first):
            yield record, decode_record(path, payload)
        check_gap(path, data, position, start)
        if is_last and (rest := start + len(data) - position.end) > 0:
            _warn(
                f"{path}: ends with an incomplete record of {rest} bytes: it is being "
                "written, or a kill cut it and resume will drop it"
            )
        if not is_last:
            sys.stdout.flush()
            time.sleep(POLL_S)


def _read(path: Path, start: int, *, is_followed: bool) -> bytes:
    try:
        with path.open("rb") as file:
            if is_empty(path, file.read(len(MAGIC))):
                return b""
            if file.seek(0, 2) < start:
                raise RunFolderError(f"{path}: was cut while it was read")
            file.seek(start)
            return file.read()
    except FileNotFoundError:
        if is_followed and start == len(MAGIC):
            return b""
        raise RunFolderError(f"{path}: was removed while it was read") from None
    except OSError as error:
        raise RunFolderError(f"{path}: {unreadable(error)}") from None


def _warn(line: str) -> None:
    sys.stdout.flush()
    print(line, file=sys.stderr)


def parser(_command: str = "log") -> Flags:
    """Return the parser of ``revolve log``."""
    flags = Flags(
        prog="revolve log",
        description="Print the journal of a run, one line per event: the answers of "
        "analyzers and workers and the orders of operators, in the order in which the "
        "run acted on them. A birth is ISLAND:NUMBER. The field 'try' counts the "
        "attempts of a birth and the evaluations of a robot. The command only reads, "
        "so it can be used while the coordinator is running.",
        examples=(
            "revolve log runs/scenario1-seed1 --follow",
            "revolve log runs/scenario1-seed1 --birth 12 --json",
        ),
    )
    flags.add_argument("folder", type=Path, metavar="RUN", help="run folder")
    islands = "island number; only events of this island are printed (default: all)"
    add_count(flags, "--island", None, islands, least=0)
    flags.add_argument(
        "--birth",
        type=birth_name,
        default=(None, None),
        metavar="N|ISLAND:N",
        help="only events of the robot with birth number N, on any island or on island "
        "ISLAND; of an advance of an arena, only the state of that robot is printed "
        "(default: all)",
    )
    flags.add_argument(
        "--json", action="store_true", help="print JSON, one object per line"
    )
    flags.add_argument(
        "--follow",
        action="store_true",
        help="wait for more events until the run is finished; press Ctrl-C to stop",
    )
    return flags
