"""Groups of islands: their flags, and several coordinators on one machine."""

import os
import secrets
import signal
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack, suppress
from itertools import chain
from multiprocessing import get_context
from multiprocessing.context import SpawnProcess
from pathlib import Path
from uuid import uuid4

from msgspec import structs

from coordinator.cli.deployment import Deployment, own_hub, own_processes
from coordinator.cli.progress import Display
from coordinator.cli.status_text import births_done, run_details
from coordinator.network.client_service import asking
from coordinator.run.group_link import births_digest
from coordinator.storage.campaign import Campaign
from coordinator.storage.folder import read_details
from coordinator.storage.folder_status import folder_status, unbegun_status
from coordinator.storage.hints import command, stopped
from schema.agent.log import tell_error, warn_user
from schema.agent.stopping import STOPPED, advise, tell_stopped
from schema.agent.supervisor import (
    start_without_ctrl_c,
    stop_on_signals,
    stop_with_parent,
)
from schema.errors import (
    ExperimentError,
    MalformedMessage,
    NetworkError,
    RevolveError,
    RunFolderError,
    one_line,
)
from schema.experiment.document import Experiment, island_count
from schema.experiment.identity import Group
from schema.tables.description import RunDetails, groups_of, make_folder
from schema.wire.codec import encode
from schema.wire.operator import GetStatus, OperatorRequest, decode_operator_reply
from schema.wire.status import RunStatus, Status, joined

Main = Callable[[list[str]], int]
"""Runs a command of the coordinator and returns its exit code."""
Commands = dict[Path, tuple[RunDetails, list[str]]]
"""Description of each group and the command of its coordinator, by folder."""

_WITH_VALUE = (
    *("--speed", "--arena-workers", "--audit", "--on-quarantine", "--fleet"),
    *("--tls-ca", "--tls-certificate", "--tls-key"),
)
"""Flags with a value that each group's coordinator gets."""
_NO_STATUS = Status((), 0, 0, 0.0)
_TURN_S = 1.0
_STOP_S = 30.0
"""Time for coordinators to write their tables, on a busy machine as well [s]."""
_HUB_S = 30.0
"""Time without a hub after which a coordinator of a group ends [s]."""


def check_groups(
    experiments: Sequence[Experiment], of: int, flag: str, *, is_repeated: bool
) -> None:
    """Raise ``ExperimentError`` unless one experiment has islands for all groups."""
    if len(experiments) > 1 or is_repeated:
        raise ExperimentError(f"{flag}: is for a single run, not for a campaign")
    name, count = experiments[0].name, island_count(experiments[0])
    if count == 1:
        raise ExperimentError(f"{flag}: {name} has no islands to divide")
    if of > count:
        why = f"the number of islands of {name}"
        raise ExperimentError(f"{flag}: must be <= {count}, {why}, got {of}")


def archipelago_of(campaign: Campaign) -> str:
    """Return the name of an archipelago that the user has not named."""
    ((_, details),) = campaign.runs(Path())
    return births_digest(details).hex()


def groups_below(folder: Path, births: int | None = None) -> list[Path]:
    """Return the folders of all groups of a folder's archipelago; none without any.

    ``births``: number that all are to get; if a kill came in between, some have it.

    Raises:
        RunFolderError: as of ``groups_of``, or they differ in their number of births.
    """
    groups = groups_of(folder)
    if births is None and len({read_details(each).document for each in groups}) > 1:
        raise RunFolderError(
            f"{folder}: its groups differ in their number of births: give --births"
        )
    return groups


def start_groups(
    folder: Path, campaign: Campaign, of: int, words: Sequence[str]
) -> Commands:
    """Return the commands that begin an archipelago in a new folder.

    ``of``: number of groups. ``words``: experiment and flags that determine births.

    Raises:
        RunFolderError: the folder is used.
    """
    make_folder(folder)
    if any(folder.iterdir()):
        raise RunFolderError(
            f"{folder}: not empty; to resume a run: {command('resume', folder)}; or "
            "choose another folder"
        )
    name = secrets.token_hex(6)
    ((_, whole),) = campaign.runs(folder)
    commands: Commands = {}
    for number in range(of):
        group, path = Group(number=number, of=of), folder / f"group-{number}"
        flags = ["--group", str(group), "--archipelago", name, "--out", str(path)]
        details = structs.replace(whole, group=group, archipelago=name)
        commands[path] = details, ["coordinator", *words, *flags]
    return commands


def execute_groups(
    folder: Path, commands: Commands, deployment: Deployment, main: Main
) -> int:
    """Start a hub, agents and a coordinator per group; return the exit code.

    ``main``: runs a coordinator's command, in a process of its own.

    Raises:
        NetworkError: the address cannot be listened on, or no hub answers.
    """
    advise(stopped(folder, deployment.resume_flags))
    stop = stop_on_signals()
    known = {
        str(path.resolve()): unbegun_status(path, details)
        for path, (details, _) in commands.items()
    }
    failed: dict[Path, int] = {}
    with ExitStack() as stack:
        address = stack.enter_context(own_hub(folder, deployment))
        agent = deployment.agent
        ask = stack.enter_context(asking(address, fleet=agent.fleet, tls=agent.tls))
        pools = stack.enter_context(own_processes(deployment, address))
        running: dict[Path, SpawnProcess] = {}
        stack.callback(_end, running)
        for path, (_, words) in commands.items():
            running[path] = _start(main, [*words, *_flags(deployment, address)])
        display = stack.enter_context(Display(None, quiet=deployment.quiet))
        while running and not failed and not stop.wait(_TURN_S):
            display.show(_progress(ask, known), time.monotonic())
            for line in chain.from_iterable(pool.look_after() for pool in pools):
                warn_user(line)
            failed = _take_ended(running)
        # All at once before one is waited for.
        for child in running.values():
            child.terminate()
        for pool in pools:
            pool.terminate()
    for path, code in failed.items():
        tell_error(f"{path}: its coordinator ended with code {code}")
    if failed or running:
        tell_stopped()
        return 1 if failed else STOPPED
    for path in commands:
        status = folder_status(path)
        done = births_done(structs.replace(_NO_STATUS, runs=(status,)))
        print(f"{path}: {done}, {run_details(status)}")
    print(f"try next:\n  {command('analyze', folder)}")
    return 0


def _progress(
    ask: Callable[[bytes], dict[str, bytes]], known: dict[str, RunStatus]
) -> Status:
    """Return the progress of all groups; of one that does not answer, the last."""
    found = [_NO_STATUS]
    with suppress(NetworkError, MalformedMessage):
        request = OperatorRequest(uuid4().hex, 0, GetStatus())
        for data in ask(encode(request)).values():
            status = decode_operator_reply(data).status or _NO_STATUS
            own = [run for run in status.runs if run.folder in known]
            known |= {run.folder: run for run in own}
            found += [status] * bool(own)
    return structs.replace(joined(found), runs=tuple(known.values()))


def _flags(deployment: Deployment, address: str) -> list[str]:
    """Return the flags of a group's coordinator: those that a run has in common."""
    words = list(deployment.resume_flags)
    flags = ["--connect", address, "--give-up-after", f"{_HUB_S:g}", "--quiet"]
    for name in _WITH_VALUE:
        if name in words:
            flags += [name, words[words.index(name) + 1]]
    return [*flags, *(w for w in ("--allow-drift", "--fsync") if w in words)]


def _start(main: Main, words: list[str]) -> SpawnProcess:
    process = get_context("spawn").Process(target=_coordinate, args=(main, words))
    start_without_ctrl_c(process)
    return process


def _take_ended(running: dict[Path, SpawnProcess]) -> dict[Path, int]:
    """Remove the processes that have ended; return the codes of those that failed."""
    codes = {path: process.exitcode for path, process in running.items()}
    for path, code in codes.items():
        if code is not None:
            del running[path]
    return {path: code for path, code in codes.items() if code}


def _end(running: dict[Path, SpawnProcess]) -> None:
    """Let processes stop so that they can be resumed; kill those that take long."""
    until_s = time.monotonic() + _STOP_S
    for process in running.values():
        process.terminate()
    for process in running.values():
        process.join(max(0.0, until_s - time.monotonic()))
        process.kill()
        process.join()


def _coordinate(main: Main, words: list[str]) -> None:
    """Run a coordinator's command in this process, and end the process."""
    stop_with_parent(lambda: os.kill(os.getpid(), signal.SIGTERM))
    # The summary of all groups replaces that of each.
    sys.stdout = Path(os.devnull).open("w", encoding="utf-8")  # noqa: SIM115 - for good
    try:
        code = main(words)
    except RevolveError as error:
        tell_error(f"revolve: {one_line(error)}")
        code = 2
    sys.stderr.flush()
    # All is closed. The interpreter's own end takes seconds on a busy machine.
    os._exit(code)
