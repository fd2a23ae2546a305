"""Main loop of a coordinator process: runs, operators, viewers, display."""

import logging
import math
import resource
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from itertools import chain
from pathlib import Path

from coordinator.cli.deployment import Deployment, connected_agents
from coordinator.cli.progress import Display
from coordinator.cli.status_text import fault_lines
from coordinator.dispatch.fleet import JobRouter
from coordinator.network.service import Network
from coordinator.run.live_server import LiveServer
from coordinator.run.operators import answer_operator
from coordinator.run.scheduler import Planned, RunScheduler
from coordinator.run.session import RunSession
from schema.agent.log import tell_user, warn_user
from schema.agent.supervisor import stop_on_signals
from schema.errors import RevolveError
from schema.plugins.permission import allowed
from schema.wire.status import RunStatus, Status

_LOG = logging.getLogger(__name__)
_TURN_S = 0.2
_CHORES_S = 1.0
# Journal, lock and table segments of a run; and what the process itself needs.
_FILES_PER_RUN = 24
_OTHER_FILES = 200


def execute_runs(
    folder: Path,
    planned: Sequence[Planned],
    deployment: Deployment,
    conclude: Callable[[RunSession], object],
    report: Callable[[RunStatus, RevolveError], None],
) -> RunScheduler:
    """Execute runs until all are finished or a signal stops them.

    The scheduler that it returns knows what is finished and what failed.
    """
    stop = stop_on_signals()
    with ExitStack() as stack:
        publish = _open_metrics(deployment.metrics, stack)
        agents, pools = stack.enter_context(connected_agents(folder, deployment, stop))
        network = agents if isinstance(agents, Network) else None
        scheduler = RunScheduler(
            planned,
            JobRouter(
                agents,
                allows_drift=deployment.allows_drift,
                warn=_LOG.warning,
                faults=None if network is None else network.faults,
            ),
            open_run=lambda held, is_watched: RunSession(
                held,
                scheduler.fleet,
                fsync=deployment.fsync,
                speed=deployment.speed,
                parts=deployment.arena_workers,
                is_watched=is_watched and network is not None,
                checks=deployment.checks,
                migration=None if network is None else network.migration,
            ),
            most=_most_open_runs(),
            conclude=conclude,
            report=report,
        )
        stack.callback(scheduler.close)
        server = None if network is None else _Server(scheduler, network)
        place = _place_to_join(folder, deployment)
        with Display(
            scheduler, quiet=deployment.quiet, place=place, plugins=allowed()
        ) as display:
            shown_s = done_s = -math.inf
            wait_s = 0.0  # the first progress is shown at once
            while not (scheduler.is_finished or stop.is_set()):
                scheduler.turn(wait_s, time.monotonic)
                wait_s = _TURN_S
                now_s = time.monotonic()
                if now_s - shown_s >= _TURN_S:
                    shown_s = now_s
                    if server is not None:
                        server.serve(now_s)
                    if publish is not None:
                        refused = len(scheduler.fleet.dispatch.unfit())
                        refused += 0 if network is None else len(network.refused)
                        publish(scheduler.status(now_s), refused)
                    display.update(now_s)
                if now_s - done_s >= _CHORES_S:
                    done_s = now_s
                    scheduler.do_chores(now_s)
                    _tell_faults(scheduler)
                    for line in chain(*(pool.look_after() for pool in pools)):
                        warn_user(line)
            if server is not None:
                server.serve(time.monotonic())
        scheduler.stop()
        _tell_faults(scheduler)
    faults = scheduler.status(time.monotonic()).faults
    # Late answers ask for nothing; ``revolve status`` shows them.
    for line in fault_lines([each for each in faults if each.kind != "late"]):
        tell_user(line)
    return scheduler


def _place_to_join(folder: Path, deployment: Deployment) -> str:
    """Return what agents on this machine connect to; empty if some start by themselves.

    Agents of a hub with TLS need files that this process does not know.
    """
    if deployment.workers or deployment.answers is not None or deployment.agent.tls:
        return ""
    return deployment.connect or str(folder)


def _open_metrics(
    address: tuple[str, int] | None, stack: ExitStack
) -> Callable[[Status, int], None] | None:
    """Serve metrics until the stack is closed; return what publishes a snapshot."""
    if address is None:
        return None
    from coordinator.cli.metrics import MetricsServer

    metrics = stack.enter_context(MetricsServer(*address))
    tell_user(f"metrics at {metrics.url}")
    return metrics.publish


def _tell_faults(scheduler: RunScheduler) -> None:
    """Tell the user what peers have begun to send that is not used."""
    for line in scheduler.fleet.faults.lines():
        warn_user(line)


class _Server:
    """Answers operators of all runs and viewers of the watched run."""

    def __init__(self, scheduler: RunScheduler, network: Network) -> None:
        self._scheduler = scheduler
        self._network = network
        self._watched: RunSession | None = None
        self._live: LiveServer | None = None

    def serve(self, now_s: float) -> None:
        """Answer what has arrived."""
        for order in self._network.queries.orders():
            order.reply(answer_operator(self._scheduler, order.data, now_s))
        run = self._scheduler.watched
        if run is not self._watched:
            if self._live is not None:
                self._live.close()
            self._watched, self._live = run, None
            if run is not None and run.feed is not None:
                fleet = self._scheduler.fleet
                self._live = LiveServer(run.feed, run.loop, fleet, self._network)
        if self._live is not None:
            self._live.serve(now_s)


def _most_open_runs() -> int:
    """Raise the limit of open files; return how many runs it allows at a time."""
    _, hard = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (hard, hard))
    return max(1, (hard - _OTHER_FILES) // _FILES_PER_RUN)
