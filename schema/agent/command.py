"""Commands ``revolve worker`` and ``revolve analyzer``.

One process does one job at a time. The command starts the given number of processes,
restarts those that end, and stops all on Ctrl-C. It gives up when all of them exited by
themselves.
"""

import argparse
import re
import socket
import sys
from collections.abc import Callable
from pathlib import Path

from schema.agent.network import DEFAULT_FLEET, Agent, Tls, client_config
from schema.agent.supervision import CPU_LIMIT_S, Death, ProcessSlot
from schema.agent.supervisor import ProcessPool, stop_on_signals, stop_with_input
from schema.agent.topics import Role, check_name
from schema.errors import NetworkError, RevolveError
from schema.experiment.plugin_access import allow, allowed
from schema.flags import Flags, add_plugins, positive_number, whole_number

_POLL_S = 0.5


def add_network_flags(flags: argparse.ArgumentParser) -> None:
    """Add the flags for the fleet and its certificates."""
    flags.add_argument(
        "--fleet",
        default=DEFAULT_FLEET,
        help=f"name of the fleet (default: {DEFAULT_FLEET})",
    )
    flags.add_argument(
        "--tls-ca", metavar="FILE", help="certificate authority of the fleet (PEM)"
    )
    flags.add_argument("--tls-certificate", metavar="FILE", help="certificate (PEM)")
    flags.add_argument("--tls-key", metavar="FILE", help="private key (PEM, PKCS#8)")


def add_cpu_limit(flags: argparse.ArgumentParser) -> None:
    """Add the flag for the CPU time limit of a job."""
    flags.add_argument(
        "--cpu-limit",
        type=positive_number,
        default=CPU_LIMIT_S,
        metavar="S",
        help=f"CPU time limit of one job in seconds (default: {CPU_LIMIT_S:.0f})",
    )


def tls_of(options: argparse.Namespace) -> Tls | None:
    """Return the files that flags name; None if they name none.

    Raises:
        NetworkError: one is not named, or not there.
    """
    files = {
        "--tls-ca": options.tls_ca,
        "--tls-certificate": options.tls_certificate,
        "--tls-key": options.tls_key,
    }
    if not any(files.values()):
        return None
    for flag, file in files.items():
        if not file:
            raise NetworkError(f"{flag} is missing: {', '.join(files)} go together")
        if not Path(file).is_file():
            raise NetworkError(f"{flag}: no such file: {file}")
    return Tls(options.tls_ca, options.tls_certificate, options.tls_key)


def host_name() -> str:
    """Return this machine's name with the characters that a key allows."""
    return re.sub(r"[^A-Za-z0-9-]", "-", socket.gethostname()).strip("-")[:40] or "host"


def run_pool(
    role: Role,
    body: Callable[[Agent, ProcessSlot], None],
    arguments: list[str],
    processes: int,
) -> int:
    """Run a command that serves jobs until Ctrl-C, and return its exit status.

    Args:
        role: "worker" or "analyzer".
        body: run by each process, with its agent and its slot.
        arguments: of the user, after the command's name.
        processes: default number of processes.
    """
    flags = _flags(role, processes)
    options = flags.parse_args(arguments)
    try:
        allow(options.plugins)
        agent = Agent(
            role,
            check_name(options.name, "--name"),
            options.connect,
            check_name(options.fleet, "--fleet"),
            tls=tls_of(options),
            threads=options.threads,
            cpu_limit_s=options.cpu_limit,
            plugins=allowed(),
        )
        client_config(agent.connect, agent.tls)
    except RevolveError as error:
        flags.error(str(error))
    stop = stop_on_signals()
    if options.until_closed:
        stop_with_input(stop)
    restarts = deaths = 0
    try:
        with ProcessPool(body, (agent,), size=options.processes) as process_pool:
            while not stop.is_set():
                process_pool.look_after()
                process_pool.wait(_POLL_S)
                for death in process_pool.deaths[deaths:]:
                    sys.stderr.write(f"{tell_death(death)}\n")
                if process_pool.restarts > restarts:
                    sys.stderr.write(f"a {role} process ended and is restarted\n")
                restarts, deaths = process_pool.restarts, len(process_pool.deaths)
                if len(process_pool.exit_codes) == options.processes:
                    return max(process_pool.exit_codes)
    except KeyboardInterrupt:
        return 130
    return 0


def tell_death(death: Death) -> str:
    """Return a line about the job that crashed a process."""
    task = death.task
    return f"{task.agent} died of job {task.number} of {task.run}: {death.cause}"


def _flags(role: Role, processes: int) -> argparse.ArgumentParser:
    flags = Flags(
        prog=f"revolve {role}",
        description=f"Serve coordinators as {role} until Ctrl-C.",
        epilog=f"example: revolve {role} --connect tcp/127.0.0.1:7447 --processes 2",
        allow_abbrev=False,
    )
    flags.add_argument(
        "--connect",
        required=True,
        metavar="ADDRESS",
        help="the coordinator's address, tcp/HOST:PORT or tls/HOST:PORT",
    )
    flags.add_argument(
        "--processes",
        type=whole_number(),
        default=processes,
        metavar="N",
        help=f"number of processes (default: {processes})",
    )
    flags.add_argument(
        "--name",
        default=host_name(),
        help="name of this machine (default: its host name)",
    )
    flags.add_argument(
        "--until-closed",
        action="store_true",
        help="stop when standard input is closed, too",
    )
    add_cpu_limit(flags)
    add_plugins(flags)
    flags.set_defaults(threads=1)
    if role == "worker":
        flags.add_argument(
            "--threads",
            type=whole_number(),
            metavar="N",
            help="threads of each process for one arena (default: 1)",
        )
    add_network_flags(flags)
    return flags
