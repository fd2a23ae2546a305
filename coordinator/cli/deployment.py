"""Deployment of a run: its network, its own processes, its viewer."""

import contextlib
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, replace
from math import ceil
from pathlib import Path

from coordinator.dispatch.events import AgentKind
from coordinator.network.hub_service import open_hub
from coordinator.network.local import LocalAgents
from coordinator.network.service import Network
from coordinator.run.cross_checks import NO_CHECKS, Checks
from coordinator.run.live_server import open_viewer
from coordinator.storage.disk import replace_text
from coordinator.storage.hints import keep_flags
from schema.agent.access import Certificate
from schema.agent.address import ADDRESS, new_socket
from schema.agent.command import name_at
from schema.agent.log import tell_user
from schema.agent.machine import platform_tag
from schema.agent.network import Agent, hub_config
from schema.agent.request_handler import Compute
from schema.agent.supervision import ProcessSlot
from schema.agent.supervisor import ProcessPool
from schema.agent.topics import unique_name
from schema.plugins.permission import allowed

WORKERS_PER_ANALYZER = 40
"""Workers that one analyzer keeps busy: a birth takes 1 ms, an evaluation 40 ms.

Both are measured with scenario 1; other evaluations take longer.
"""


@dataclass(frozen=True, slots=True)
class Deployment:
    """Processes and network of a run; none of these settings changes a birth.

    Attributes:
        agent: fleet, certificate files, threads and limits of the processes here; each
            has its own role, name and hub.
        workers: worker processes to start here; enough analyzers start with them.
        bodies: function that a process of each kind runs.
        answers: functions that replace processes and network, or None.
        listen: address of the hub beside its own Unix socket; None: only that socket.
        connect: address of an existing hub; None: this process is the hub.
        certificates: those that may connect to this hub; None: all of the authority.
        speed: limit of simulated seconds per second for arenas; None: no limit.
        arena_workers: workers that advance one arena; None: as many as pay.
        resume_flags: with which ``revolve resume`` has the same agents again.
    """

    agent: Agent
    workers: int
    bodies: Mapping[AgentKind, Callable[[Agent, ProcessSlot], None]]
    answers: Mapping[AgentKind, Compute] | None
    listen: str | None
    connect: str | None
    quiet: bool
    fsync: bool
    speed: float | None = None
    arena_workers: int | None = None
    view: bool = False
    checks: Checks = NO_CHECKS
    certificates: tuple[Certificate, ...] | None = None
    allows_drift: bool = False
    metrics: tuple[str, int] | None = None
    resume_flags: tuple[str, ...] = ()


@contextmanager
def connected_agents(
    folder: Path, deployment: Deployment, stop: threading.Event
) -> Iterator[tuple[Network | LocalAgents, list[ProcessPool]]]:
    """Open the connection to agents and start the processes of a deployment.

    ``stop`` ends the wait for a hub.

    Yields:
        The connection, and the process pools, which need regular supervision.
    """
    if deployment.answers is not None:
        keep_flags(folder, deployment.resume_flags)
        yield LocalAgents(deployment.answers, platform_tag()), []
        return
    fleet, tls = deployment.agent.fleet, deployment.agent.tls
    with ExitStack() as stack:
        hub = deployment.connect or ""
        network = stack.enter_context(
            Network(
                name=unique_name(name_at(hub, tls, "coordinator")),
                fleet=fleet,
                listen=(deployment.listen,) if deployment.listen else (),
                connect=hub,
                tls=tls,
                certificates=deployment.certificates,
                give_up_after_s=deployment.agent.give_up_after_s,
                stop=stop,
            )
        )
        # The folder of a run that finds no hub stays empty.
        keep_flags(folder, deployment.resume_flags)
        _note_addresses(folder, (network.address, network.own_address), stack)
        if deployment.view:
            open_viewer(network.own_address, fleet, tls)
        pools = stack.enter_context(own_processes(deployment, network.own_address))
        if deployment.listen is not None:
            tell_user(f"listening on {network.address}")
        yield network, pools


@contextmanager
def own_hub(folder: Path, deployment: Deployment) -> Iterator[str]:
    """Open a hub in this process for the coordinators of a folder, unless one is given.

    Yields:
        The address where processes of this machine connect to.
    """
    with ExitStack() as stack:
        address, others = deployment.connect or new_socket(), deployment.listen
        addresses = (*([others] if others else []), address)
        if not deployment.connect:
            tls, certificates = deployment.agent.tls, deployment.certificates
            config = hub_config(addresses, tls, certificates)
            stack.enter_context(open_hub(config, addresses))
        keep_flags(folder, deployment.resume_flags)
        _note_addresses(folder, addresses, stack)
        if others:
            tell_user(f"listening on {others}")
        yield address


@contextmanager
def own_processes(deployment: Deployment, address: str) -> Iterator[list[ProcessPool]]:
    """Start the workers of a deployment, and the analyzers that they need."""
    with ExitStack() as stack:
        workers = deployment.workers
        analyzers = ceil(workers / WORKERS_PER_ANALYZER)
        sizes: dict[AgentKind, int] = {"analyzer": analyzers, "worker": workers}
        pools: list[ProcessPool] = []
        for kind, size in sizes.items() if workers else ():
            agent = replace(
                deployment.agent,
                role=kind,
                name=f"own-{kind}",
                connect=address,
                # The run's copies, which are there by now.
                plugins=allowed(),
                processes=size,
            )
            pool = ProcessPool(deployment.bodies[kind], (agent,), size=size, role=kind)
            pools.append(pool)
        # Their server imports the code of all pools that exist when the first starts.
        for pool in pools:
            stack.enter_context(pool)
        # All at once before one is waited for: their grace times run together.
        for pool in pools:
            stack.callback(pool.terminate)
        yield pools


def _note_addresses(folder: Path, addresses: Iterable[str], stack: ExitStack) -> None:
    """Write the addresses of a hub to a folder; the stack removes them."""
    file = folder / ADDRESS
    # Written whole: other processes wait for the file and read it at once.
    text = "\n".join(dict.fromkeys((*addresses, "")))
    replace_text(file, text)
    stack.callback(_remove, file, text)


def _remove(file: Path, text: str) -> None:
    """Remove a file, unless a later coordinator has replaced its text."""
    with contextlib.suppress(OSError):
        if file.read_text(encoding="utf-8") == text:
            file.unlink()
