"""Groups of islands: their flags, and several coordinators on one machine."""

import os
import secrets
import signal
import sys
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from dataclasses import dataclass
from multiprocessing import get_context
from multiprocessing.context import SpawnProcess
from pathlib import Path
from typing import NamedTuple, Self

from msgspec import structs

from coordinator.cli.deployment import Deployment, own_hub, own_processes
from coordinator.cli.progress import Display
from coordinator.cli.status_text import births_done, run_details
from coordinator.network.client_service import Operator
from coordinator.run.group_link import births_digest
from coordinator.storage.campaign import Campaign
from coordinator.storage.folder import holds_run, read_details
from coordinator.storage.folder_status import folder_status, unbegun_status
from coordinator.storage.hints import command, stopped
from schema.agent.log import tell_error, tell_user, warn_user
from schema.agent.stopping import STOPPED, advise, tell_stopped
from schema.agent.supervisor import GRACE_S, stop_on_signals, stop_with_parent
from schema.errors import (
    ExperimentError,
    RevolveError,
    RunFolderError,
    one_line,
)
from schema.experiment.document import Experiment, island_count
from schema.experiment.identity import Group
from schema.tables.description import DETAILS, RunDetails, make_folder
from schema.wire.status import RunStatus, Status, joined

Main = Callable[[list[str]], int]
"""Runs a command of the coordinator and returns its exit code."""


class StartGroups(NamedTuple):
    """How to start the coordinators of groups.

    Attributes:
        words: experiment and flags that determine the births.
        of: number of groups.
        main: runs a coordinator's command in a process of its own.
    """

    words: Sequence[str]
    of: int
    main: Main


NO_STATUS = Status((), 0, 0, 0.0)
_TURN_S = 0.5
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


def groups_below(folder: Path) -> list[Path]:
    """Return the folders of all groups of a folder's archipelago; none without any.

    Raises:
        RunFolderError: a group is missing, there is another run, or they differ.
    """
    folders = sorted(each.parent for each in folder.glob(f"group-*/{DETAILS}"))
    if holds_run(folder) or not folders:
        return []
    known = {each: read_details(each) for each in folders}
    first = known[folders[0]]
    for path, details in known.items():
        same = structs.replace(details, group=first.group)
        if same != first or details.group.of != first.group.of:
            raise RunFolderError(
                f"{path}: must be a group of the archipelago of {folders[0]}"
            )
    of = first.group.of
    numbered = {details.group.number: path for path, details in known.items()}
    for number in range(of):
        if number not in numbered:
            raise RunFolderError(
                f"{folder}: group {Group(number=number, of=of)} is missing"
            )
    return [numbered[number] for number in range(of)]


def start_groups(
    folder: Path,
    campaign: Campaign,
    deployment: Deployment,
    start: StartGroups,
) -> int:
    """Run an archipelago in a new folder, a coordinator per group; return the code.

    Raises:
        RunFolderError: the folder is used.
        NetworkError: the address cannot be listened on, or no hub answers.
    """
    make_folder(folder)
    if any(folder.iterdir()):
        raise RunFolderError(
            f"{folder}: not empty; to resume a run: {command('resume', folder)}; or "
            "choose another folder"
        )
    name = secrets.token_hex(6)
    ((_, whole),) = campaign.runs(folder)
    begin: dict[Path, tuple[RunDetails, list[str]]] = {}
    for number in range(start.of):
        group, path = Group(number=number, of=start.of), folder / f"group-{number}"
        flags = ["--group", str(group), "--archipelago", name, "--out", str(path)]
        details = structs.replace(whole, group=group, archipelago=name)
        begin[path] = details, ["coordinator", *start.words, *flags]
    return _execute(folder, begin, deployment, start.main)


def resume_groups(
    folder: Path, groups: Sequence[Path], deployment: Deployment, main: Main
) -> int:
    """Continue all groups of a folder; return the exit code.

    Raises:
        NetworkError: the address cannot be listened on, or no hub answers.
    """
    begin = {path: (read_details(path), ["resume", str(path)]) for path in groups}
    return _execute(folder, begin, deployment, main)


def _execute(
    folder: Path,
    begin: dict[Path, tuple[RunDetails, list[str]]],
    deployment: Deployment,
    main: Main,
) -> int:
    """Start a hub, agents and a coordinator per group; return the exit code."""
    advise(stopped(folder, deployment.resume_flags))
    stop = stop_on_signals()
    known = {
        str(path.resolve()): unbegun_status(path, details)
        for path, (details, _) in begin.items()
    }
    with ExitStack() as stack:
        address = stack.enter_context(own_hub(folder, deployment))
        operator = stack.enter_context(
            Operator(address, deployment.agent.fleet, deployment.agent.tls)
        )
        progress = _Progress(operator, known)
        pools = stack.enter_context(own_processes(deployment, address))
        children = stack.enter_context(_Coordinators(main))
        for path, (_, words) in begin.items():
            children.start(path, [*words, *_flags(deployment, address)])
        display = stack.enter_context(Display(progress, quiet=deployment.quiet))
        while children.running and not children.failed and not stop.is_set():
            stop.wait(_TURN_S)
            display.show(progress.status(time.monotonic()), time.monotonic())
            for pool in pools:
                for line in pool.look_after():
                    warn_user(line)
            children.look_after()
        # All at once before one is waited for.
        children.terminate()
        for pool in pools:
            pool.terminate()
    if children.failed:
        for path, code in children.failed.items():
            tell_error(f"{path}: its coordinator ended with code {code}")
        tell_user(stopped(folder, deployment.resume_flags))
        return 1
    if stop.is_set():
        tell_stopped()
        return STOPPED
    for path in begin:
        status = folder_status(path)
        done = births_done(structs.replace(NO_STATUS, runs=(status,)))
        print(f"{path}: {done}, {run_details(status)}")
    print(f"try next:\n  {command('analyze', folder)}")
    return 0


def _flags(deployment: Deployment, address: str) -> list[str]:
    """Return the flags of a group's coordinator: those that a run has in common."""
    words = list(deployment.resume_flags)
    flags = ["--connect", address, "--give-up-after", f"{_HUB_S:g}", "--quiet"]
    for name in ("--speed", "--arena-workers", "--audit", "--on-quarantine", "--fleet"):
        if name in words:
            flags += [name, words[words.index(name) + 1]]
    return [*flags, *(w for w in ("--allow-drift", "--fsync") if w in words)]


class _Progress:
    """Progress of all groups, as their coordinators report it.

    Attributes:
        active: runs in this process: none.
    """

    def __init__(self, operator: Operator, known: dict[str, RunStatus]) -> None:
        """Initialise; ``known``: status of each group before it starts, by folder."""
        self.active: tuple[()] = ()
        self._operator, self._known = operator, known

    def status(self, _now_s: float) -> Status:
        """Return the progress of all groups; of one that does not answer, the last."""
        found = [NO_STATUS]
        for each in self._operator.statuses():
            own = [run for run in each.runs if run.folder in self._known]
            self._known |= {run.folder: run for run in own}
            found += [each] * bool(own)
        return structs.replace(joined(found), runs=tuple(self._known.values()))


@dataclass(frozen=True, slots=True)
class _Child:
    """Process of a group's coordinator."""

    folder: Path
    process: SpawnProcess


class _Coordinators:
    """Processes of coordinators; none outlives this process.

    Attributes:
        running: those that have not ended.
        failed: exit codes of those that failed, by folder.
    """

    def __init__(self, main: Main) -> None:
        self.running: list[_Child] = []
        self.failed: dict[Path, int] = {}
        self._main = main

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.terminate()
        until_s = time.monotonic() + GRACE_S
        for child in self.running:
            child.process.join(max(0.0, until_s - time.monotonic()))
            child.process.kill()
            child.process.join()

    def start(self, folder: Path, words: list[str]) -> None:
        """Start the coordinator of a group's folder."""
        arguments = (self._main, words)
        process = get_context("spawn").Process(target=_coordinate, args=arguments)
        # A Ctrl-C of the terminal reaches all; only this process may act on it.
        before = signal.pthread_sigmask(signal.SIG_BLOCK, {signal.SIGINT})
        try:
            process.start()
        finally:
            signal.pthread_sigmask(signal.SIG_SETMASK, before)
        self.running.append(_Child(folder, process))

    def look_after(self) -> None:
        """Note which have ended."""
        for child in list(self.running):
            if (code := child.process.exitcode) is not None:
                self.running.remove(child)
                if code not in (0, STOPPED):
                    self.failed[child.folder] = code

    def terminate(self) -> None:
        """Ask all to stop, so that they can be resumed."""
        for child in self.running:
            child.process.terminate()


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
