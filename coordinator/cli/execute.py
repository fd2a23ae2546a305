"""Runs from their first birth to their last, or to the next resume."""

import contextlib
import math
import resource
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from coordinator.cli.progress import Display
from coordinator.cli.summary import Conclusion, conclude, failures
from coordinator.dispatch.events import AgentKind
from coordinator.dispatch.fleet import Agents, Fleet
from coordinator.network.local import LocalAgents
from coordinator.network.service import Network
from coordinator.run.cross_checks import NO_CHECKS, Checks
from coordinator.run.live_server import LiveServer, open_viewer
from coordinator.run.operators import Reception
from coordinator.run.scheduler import Planned, RunScheduler
from coordinator.run.session import RunSession
from coordinator.storage.campaign import (
    Campaign,
    CampaignFolder,
    check_adopted,
    forget_campaign,
    is_campaign,
    read_campaign,
    refuse_used,
    write_campaign,
)
from coordinator.storage.disk import replace_durably
from coordinator.storage.folder import (
    RunDetails,
    RunFolder,
    holds_run,
    read_details,
    read_state,
)
from coordinator.storage.folder_status import (
    check_rewritable,
    folder_status,
    unbegun_status,
)
from coordinator.storage.hints import command, stopped
from schema.agent.network import THIS_MACHINE, Agent, Tls
from schema.agent.platform_tag import platform_tag
from schema.agent.service import tell_user
from schema.agent.supervision import CPU_LIMIT_S, ProcessSlot
from schema.agent.supervisor import ProcessPool, stop_on_signals
from schema.agent.topics import unique_name
from schema.errors import NetworkError, RevolveError
from schema.experiment.document import Experiment
from schema.experiment.file import experiment_from_text, experiment_text
from schema.tables.files import has_rows

ADDRESS = "address"
"""File of a run's or campaign's folder that says where its hub is, while it lives."""

_LOOK_S = 0.2
_CHORES_S = 1.0
# Journal, lock and the segments of a run; and what the process itself needs.
_FILES_OF_A_RUN = 24
_OTHER_FILES = 200


@dataclass(frozen=True, slots=True)
class Deployment:
    """Where and by whom a run is done; none of it changes a birth.

    Attributes:
        workers: worker processes to start here; an analyzer comes with them.
        bodies: what a process of each kind runs (agent, post).
        answers: functions in place of processes and network, or None.
        listen: address of the hub; any free port of this machine if None.
        connect: address of a hub that is there already; None: be one.
        fleet: whose agents to use.
        tls: files for a ``tls/`` address.
        quiet: show nothing but the end.
        fsync: survive power loss, too.
        threads: that advance one arena together in a process here.
        speed: simulated seconds per second at most, of arenas; None: no limit.
        view: a viewer is to be opened; the run does not wait for it.
        cpu_limit_s: CPU time of a job after which its process here is ended [s].
        checks: what to look out for.
        allows_drift: an arena may go on by another platform where its own is gone.
    """

    workers: int
    bodies: Mapping[AgentKind, Callable[[Agent, ProcessSlot], None]]
    answers: Mapping[AgentKind, Callable[[bytes], bytes]] | None
    listen: str | None
    connect: str | None
    fleet: str
    tls: Tls | None
    quiet: bool
    fsync: bool
    threads: int = 1
    speed: float | None = None
    view: bool = False
    cpu_limit_s: float = CPU_LIMIT_S
    checks: Checks = NO_CHECKS
    allows_drift: bool = False


def start(
    folder: Path, experiment: Experiment, seed: int, deployment: Deployment
) -> int:
    """Run an experiment in a new folder; return the exit code.

    Raises:
        RunFolderError: the folder is used or held, or the disk fails.
        NetworkError: the address cannot be listened on, or no hub is there.
        ExperimentError: no robot meets its restrictions.
    """
    details = RunDetails(experiment.name, 0, seed, experiment_text(experiment))
    return _alone(folder, RunFolder(folder, details), deployment)


def start_campaign(folder: Path, campaign: Campaign, deployment: Deployment) -> int:
    """Run a campaign in a folder; return the exit code.

    Runs of it that are in the folder already are taken as they are.

    Raises:
        RunFolderError: the folder is used or held, or the disk fails.
        NetworkError: the address cannot be listened on, or no hub is there.
    """
    with CampaignFolder(folder):
        refuse_used(folder)
        planned, barren = _plan(folder, campaign)
        begun = _begun(folder, campaign)
        write_campaign(folder, campaign)
        try:
            return _together(folder, planned, barren, deployment)
        except NetworkError:
            if _begun(folder, campaign) == begun:
                forget_campaign(folder)
            raise


def _begun(folder: Path, campaign: Campaign) -> int:
    """Return how many runs of a campaign are there, be it no more than a beginning."""
    return sum(holds_run(path) for path, _ in campaign.runs(folder))


def resume(folder: Path, deployment: Deployment) -> int:
    """Go on with the run or the campaign of a folder; return the exit code.

    Raises:
        RunFolderError: neither is there, it is held by another coordinator, its
            journal is damaged, or the disk fails.
        NetworkError: the address cannot be listened on, or no hub is there.
        ExperimentError: no robot meets a run's restrictions.
    """
    if is_campaign(folder):
        with CampaignFolder(folder):
            planned, barren = _plan(folder, read_campaign(folder))
            return _together(folder, planned, barren, deployment)
    if read_state(folder) == "finished":
        if has_rows(folder, "births"):
            tell_user(f"{folder}: is finished; nothing is left to do")
            return 0 if _has_judged(folder) else 1
        check_rewritable(folder, read_details(folder))
        tell_user(f"{folder}: its tables are gone: the journal gives them again")
    return _alone(folder, RunFolder(folder), deployment)


def _alone(folder: Path, held: RunFolder, deployment: Deployment) -> int:
    """Do the run of a folder that is held, and tell what came of it."""
    with held:
        status = unbegun_status(folder, held.details)
        said: list[Conclusion] = []
        try:
            scheduler = _conduct(
                folder,
                [Planned(held.details, status, lambda: held)],
                deployment,
                lambda run: said.append(_conclusion(run)),
                lambda _details, _error: None,  # it is raised
            )
        except NetworkError:
            held.forget()
            raise
    for _, error in scheduler.failed:
        raise error
    if not scheduler.is_finished:
        tell_user(stopped(folder))
        return 130
    print(said[0].text)
    return 0 if said[0].is_judged else 1


def _plan(folder: Path, campaign: Campaign) -> tuple[list[Planned], list[Path]]:
    """Return all runs of a campaign, and where nobody could be judged of the finished.

    Raises:
        RunFolderError: a run that is there is another one.
    """
    planned, barren = [], []
    for path, details in campaign.runs(folder):
        status = unbegun_status(path, details)
        try:
            if not holds_run(path):
                take = partial(RunFolder, path, details)
                planned.append(Planned(details, status, take))
                continue
            found, status = read_details(path), folder_status(path)
            if status.state == "finished" and not _has_judged(path):
                barren.append(path)
        except RevolveError as error:
            # It cannot go on, and is no reason for the others not to.
            planned.append(Planned(details, status, partial(_refuse, error)))
            continue
        check_adopted(path, found, details)
        theirs, ours = (
            experiment_from_text(each.document).births for each in (found, details)
        )
        if theirs != ours:
            tell_user(f"{path}: is taken as it is, with {theirs} births, not {ours}")
        planned.append(Planned(found, status, partial(RunFolder, path)))
    return planned, barren


def _has_judged(folder: Path) -> bool:
    """Return whether anybody of a finished run could be judged."""
    return failures(folder)[1]


def _refuse(error: RevolveError) -> RunFolder:
    raise error


def _together(
    folder: Path, planned: Sequence[Planned], barren: list[Path], deployment: Deployment
) -> int:
    """Do all runs of a campaign, and tell what came of them.

    Args:
        folder: of the campaign.
        planned: its runs.
        barren: folders of finished ones in which nobody could be judged.
        deployment: where and by whom.
    """
    there = sum(one.status.state == "finished" for one in planned)
    if there:
        tell_user(f"{there} of {len(planned)} runs are finished already")

    def conclude_run(run: RunSession) -> None:
        conclusion = _conclusion(run)
        if conclusion.failures:
            tell_user(f"{run.held.path}: {conclusion.failures}")
        if not conclusion.is_judged:
            barren.append(run.held.path)

    scheduler = _conduct(folder, planned, deployment, conclude_run, _report)
    if not scheduler.is_finished:
        tell_user(stopped(folder))
        return 130
    if scheduler.failed:
        tell_user(
            f"{len(scheduler.failed)} of {len(planned)} runs failed; when that is "
            f"mended: {command('resume', folder)}"
        )
        return 1
    print(
        f"{len(planned)} runs are finished\ntry next:\n  {command('analyze', folder)}"
    )
    return 1 if barren else 0


def _conclusion(run: RunSession) -> Conclusion:
    return conclude(run.held.path, run.experiment, run.loop.islands)


def _conduct(
    place: Path,
    planned: Sequence[Planned],
    deployment: Deployment,
    conclude_run: Callable[[RunSession], object],
    report: Callable[[RunDetails, RevolveError], None],
) -> RunScheduler:
    """Do runs until all are done or somebody says stop.

    Args:
        place: folder that shall tell where the coordinator listens.
        planned: the runs.
        deployment: where and by whom.
        conclude_run: told of each run that is finished.
        report: told of each run that cannot go on, and why.
    """
    stop = stop_on_signals()
    with ExitStack() as stack:
        agents, process_pools = stack.enter_context(_agents(place, deployment))
        scheduler = RunScheduler(
            planned,
            Fleet(agents, allows_drift=deployment.allows_drift),
            open_run=lambda held, is_watched: RunSession(
                held,
                scheduler.fleet,
                fsync=deployment.fsync,
                speed=deployment.speed,
                is_watched=is_watched and isinstance(agents, Network),
                checks=deployment.checks,
            ),
            most=_most_at_once(),
            conclude=conclude_run,
            report=report,
        )
        stack.callback(scheduler.close)
        serve = _servant(scheduler, agents)
        with Display(scheduler, quiet=deployment.quiet) as display:
            shown_s = done_s = -math.inf
            while not (scheduler.is_finished or stop.is_set()):
                scheduler.turn(_LOOK_S, time.monotonic)
                now_s = time.monotonic()
                if now_s - shown_s >= _LOOK_S:
                    shown_s = now_s
                    serve(now_s)
                    display.update(now_s)
                if now_s - done_s >= _CHORES_S:
                    done_s = now_s
                    scheduler.do_chores(now_s)
                    for look_after in process_pools:
                        look_after()
            serve(time.monotonic())
        scheduler.stop()
    return scheduler


def _report(details: RunDetails, error: RevolveError) -> None:
    tell_user(f"{details.name}-{details.run} failed: {error}")


def _most_at_once() -> int:
    """Return how many runs may have their files open, as many as this system lets."""
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
    return max(1, (hard - _OTHER_FILES) // _FILES_OF_A_RUN)


def _servant(scheduler: RunScheduler, agents: Agents) -> Callable[[float], None]:
    """Return what serves operators and viewers; a run without a network has none."""
    if not isinstance(agents, Network):
        return lambda _: None
    reception = Reception(scheduler)
    live_server: list[tuple[RunSession, LiveServer]] = []

    def serve(now_s: float) -> None:
        for order in agents.orders():
            order.reply(reception.answer(order.data, now_s))
        run = scheduler.watched
        if live_server and live_server[0][0] is not run:
            live_server.pop()[1].close()
        if run is not None and run.feed is not None:
            if not live_server:
                shown = LiveServer(run.feed, run.loop, scheduler.fleet, agents)
                live_server.append((run, shown))
            live_server[0][1].serve(now_s)

    return serve


@contextmanager
def _agents(
    place: Path, deployment: Deployment
) -> Iterator[tuple[Agents, list[Callable[[], None]]]]:
    """Give whoever does the work, and what looks after them from time to time."""
    if deployment.answers is not None:
        yield LocalAgents(deployment.answers, platform_tag()), []
        return
    with ExitStack() as stack:
        network = stack.enter_context(
            Network(
                name=unique_name("coordinator"),
                fleet=deployment.fleet,
                listen=(deployment.listen or THIS_MACHINE,),
                connect=deployment.connect or "",
                tls=deployment.tls,
            )
        )
        note = place / ADDRESS
        # Whoever waits for the file shall find the address in it.
        text = f"{network.address}\n"
        replace_durably(note, lambda file: file.write_text(text, encoding="utf-8"))
        stack.callback(_take_away, note, text)
        if deployment.view:
            open_viewer(network.address, deployment.fleet, deployment.tls)
        process_pools: list[Callable[[], None]] = []
        sizes: dict[AgentKind, int] = {"analyzer": 1, "worker": deployment.workers}
        for kind, size in sizes.items() if deployment.workers else ():
            agent = Agent(
                kind, f"own-{kind}", network.address, deployment.fleet,
                tls=deployment.tls, threads=deployment.threads,
                cpu_limit_s=deployment.cpu_limit_s,
            )  # fmt: skip
            process_pool = ProcessPool(deployment.bodies[kind], (agent,), size=size)
            process_pools.append(stack.enter_context(process_pool).look_after)
        if deployment.listen is not None:
            tell_user(f"listening on {network.address}")
        yield network, process_pools


def _take_away(note: Path, text: str) -> None:
    """Remove a file, unless whoever came after us has written another."""
    with contextlib.suppress(OSError):
        if note.read_text(encoding="utf-8") == text:
            note.unlink()
