"""Commands ``revolve worker`` and ``revolve analyzer``.

One process does one job at a time. The command starts the given number of processes,
restarts those that end, and stops all on Ctrl-C. It gives up when all of them exited by
themselves.
"""

import argparse
import math
import os
import re
import socket
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from typing import Any

from schema.agent.access import Certificate, read_certificates
from schema.agent.address import CONNECT_VARIABLE, FORMS, HUB, hub_of, user_hub
from schema.agent.flags import Flags, add_plugins, positive_number, whole_number
from schema.agent.log import LOG_VARIABLE, start_log, tell_error, warn_user
from schema.agent.network import DEFAULT_FLEET, Agent, Tls, client_config, hub_config
from schema.agent.service import GAVE_UP, gave_up
from schema.agent.supervision import CPU_LIMIT_S, WAIT_LIMIT_S, ProcessSlot
from schema.agent.supervisor import (
    MOST_PER_CORE,
    ProcessPool,
    cores,
    most_processes,
    stop_on_signals,
    stop_with_input,
)
from schema.agent.topics import Role, check_name
from schema.errors import NetworkError, RevolveError
from schema.plugins.permission import allow, allowed

_POLL_S = 0.5
_TLS_FILES = {
    "--tls-ca": "certificate authority of the fleet (PEM)",
    "--tls-certificate": "certificate (PEM)",
    "--tls-key": "private key (PEM, PKCS#8)",
}
"""Flags of certificate files; each takes its default from the environment."""


def _variable(flag: str) -> str:
    """Return the environment variable of a flag, such as ``REVOLVE_TLS_CA``."""
    return f"REVOLVE{flag[1:].replace('-', '_').upper()}"


def connect_of(options: argparse.Namespace) -> str:
    """Return the address of the hub that ``--connect`` or its default means.

    Raises:
        NetworkError: an invalid address, or a folder without an active run.
    """
    given = options.connect
    try:
        return hub_of(given or os.environ.get(CONNECT_VARIABLE) or HUB)
    except NetworkError as error:
        where = "--connect" if given else f"${CONNECT_VARIABLE}"
        raise NetworkError(f"{where}: {error}") from None


def listen_of(places: Iterable[str], tls: Tls | None) -> tuple[str, ...]:
    """Return the addresses that ``--listen`` means.

    Raises:
        NetworkError: an address of no allowed form, or that must not be listened on.
    """
    addresses = tuple(user_hub() if place == HUB else place for place in places)
    try:
        hub_config(addresses, tls)
    except NetworkError as error:
        raise NetworkError(f"--listen: {error}") from None
    return addresses


SHARED: dict[str, dict[str, Any]] = {
    "--connect": {
        "metavar": "ADDRESS",
        "help": f"address of the hub, {FORMS}, or the folder of an active run "
        f"(default: ${CONNECT_VARIABLE}, else this user's hub on this machine)",
    },
    "--fleet": {
        "default": DEFAULT_FLEET,
        "metavar": "NAME",
        "help": f"name of the fleet (default: {DEFAULT_FLEET})",
    },
    **{
        flag: {"metavar": "FILE", "help": f"{what} (default: ${_variable(flag)})"}
        for flag, what in _TLS_FILES.items()
    },
    "--log-json": {
        "action": "store_true",
        "help": "write each log line as a JSON object (default: the form in "
        f"${LOG_VARIABLE}; without it plain text, with time and level unless standard "
        "error is a terminal)",
    },
    "--access": {
        "metavar": "FILE",
        "help": "file that lists the certificates that may connect and their roles: "
        "access.json of a 'revolve cluster' kit (default: any certificate of the "
        "authority may do anything)",
    },
    "--cpu-limit": {
        "type": positive_number,
        "default": CPU_LIMIT_S,
        "metavar": "S",
        "help": f"CPU time limit of a job in seconds (default: {CPU_LIMIT_S:.0f})",
    },
    "--wait-limit": {
        "type": positive_number,
        "default": WAIT_LIMIT_S,
        "metavar": "S",
        "help": "time in seconds that a job may wait without using CPU time (default: "
        f"{WAIT_LIMIT_S:.0f})",
    },
    "--give-up-after": {
        "type": positive_number,
        "default": math.inf,
        "metavar": "S",
        "help": "stop with exit code 1 when no hub has answered for S seconds "
        "(default: retry for ever, but a run does not begin without a hub)",
    },
    "--oversubscribe": {
        "action": "store_true",
        "help": f"allow more than {MOST_PER_CORE} processes per core",
    },
}
"""Flags that several commands have, as argparse takes them."""
NETWORK = ("--fleet", *_TLS_FILES)
LIMITS = ("--cpu-limit", "--wait-limit")


def add_shared(flags: argparse.ArgumentParser, *names: str) -> None:
    """Add flags of ``SHARED``."""
    for name in names:
        flags.add_argument(name, **SHARED[name])


def access_of(options: argparse.Namespace) -> tuple[Certificate, ...] | None:
    """Return the certificates that ``--access`` lists; None without it."""
    return tuple(read_certificates(Path(options.access))) if options.access else None


def check_load(
    flags: argparse.ArgumentParser,
    flag: str,
    processes: int,
    options: argparse.Namespace,
) -> None:
    """Exit with an error if a command is to start too many processes."""
    most = most_processes()
    if processes > most and not options.oversubscribe:
        flags.error(
            f"{flag}: must be <= {most}, {MOST_PER_CORE} for each of {cores()} cores, "
            f"got {processes}; --oversubscribe allows more"
        )


def tls_files(options: argparse.Namespace) -> dict[str, str | None]:
    """Return the certificate files by flag: the flags', else the environment's."""
    given = (options.tls_ca, options.tls_certificate, options.tls_key)
    return {
        flag: file or os.environ.get(_variable(flag))
        for flag, file in zip(_TLS_FILES, given, strict=True)
    }


def tls_of(options: argparse.Namespace) -> Tls | None:
    """Return the files that flags or the environment name; None if they name none.

    Raises:
        NetworkError: one is not named, or not there.
    """
    files = tls_files(options)
    if not any(files.values()):
        return None
    for flag, file in files.items():
        if not file:
            raise NetworkError(f"{flag} is missing: {', '.join(files)} go together")
        if not Path(file).is_file():
            raise NetworkError(f"{flag}: no such file: {file}")
    return Tls(*map(str, files.values()))


def host_name() -> str:
    """Return this machine's name with the characters that a key allows."""
    return re.sub(r"[^A-Za-z0-9-]", "-", socket.gethostname()).strip("-")[:40] or "host"


def agent_of(
    options: argparse.Namespace, role: Role, name: str, *, tls: Tls | None
) -> Agent:
    """Return an agent with the fleet, limits and plug-ins of a command line."""
    return Agent(
        role,
        name,
        connect="",
        fleet=check_name(options.fleet, "--fleet"),
        tls=tls,
        threads=options.threads,
        cpu_limit_s=options.cpu_limit,
        wait_limit_s=options.wait_limit,
        plugins=allowed(),
        give_up_after_s=options.give_up_after,
    )


def run_pool(
    role: Role,
    body: Callable[[Agent, ProcessSlot], None],
    arguments: list[str],
    processes: int,
) -> int:
    """Run a command that serves jobs until Ctrl-C, and return its exit status."""
    flags = parser(role, processes)
    options = flags.parse_args(arguments)
    try:
        start_log(role, as_json=options.log_json)
        allow(options.plugins)
        connect, tls = connect_of(options), tls_of(options)
        name = _name(options.name, connect, tls)
        agent = replace(
            agent_of(options, role, name, tls=tls),
            connect=connect,
            processes=options.processes,
            tells_hub=not options.until_closed,
        )
        client_config(connect, tls)
    except RevolveError as error:
        flags.error(str(error))
    check_load(flags, "--processes", options.processes, options)
    stop = stop_on_signals()
    if options.until_closed:
        stop_with_input(stop.set)
    try:
        with ProcessPool(
            body, (agent,), size=options.processes, role=role
        ) as process_pool:
            while not stop.is_set():
                lines = process_pool.look_after()
                process_pool.wait(_POLL_S)
                if GAVE_UP in process_pool.exit_codes:
                    tell_error(gave_up(connect, options.give_up_after))
                    return 1
                if len(process_pool.exit_codes) == options.processes:
                    return max(process_pool.exit_codes)
                for line in lines:
                    warn_user(line)
    except KeyboardInterrupt:
        return 130
    return 0


def _name(given: str | None, connect: str, tls: Tls | None) -> str:
    """Return an agent's name: with TLS that of its certificate, else the machine's."""
    name = name_at(connect, tls, given or host_name())
    if tls and given not in (None, name):
        raise NetworkError(
            f"--name: must be {name!r}, the name of {tls.certificate}, got {given!r}"
        )
    return check_name(name, "--name")


def name_at(hub: str, tls: Tls | None, default: str) -> str:
    """Return the name of a process: at a hub with TLS that of its certificate."""
    if tls is None or not hub.startswith("tls/"):
        return default
    from schema.agent.certificate import certificate_name

    return certificate_name(tls.certificate)


def parser(role: Role, processes: int) -> Flags:
    """Return the parser of ``revolve worker`` or ``revolve analyzer``."""
    flags = Flags(
        prog=f"revolve {role}",
        description=f"Serve coordinators as {role} until Ctrl-C.",
        examples=(
            f"revolve {role}    # for this user's hub on this machine",
            f"revolve {role} --connect tcp/127.0.0.1:7447 --processes 2",
            f"revolve {role} --connect runs/scenario1-seed1",
        ),
    )
    add_shared(flags, "--connect")
    flags.add_argument(
        "--processes",
        type=whole_number(),
        default=processes,
        metavar="N",
        help=f"number of processes (default: {processes})",
    )
    flags.add_argument(
        "--name",
        metavar="NAME",
        help="name of this machine (default: that of its certificate, else its host "
        "name)",
    )
    flags.add_argument(
        "--until-closed",
        action="store_true",
        help="also stop when standard input is closed",
    )
    add_shared(flags, *LIMITS, "--log-json")
    add_plugins(flags)
    add_shared(flags, "--give-up-after", "--oversubscribe")
    flags.set_defaults(threads=1)
    if role == "worker":
        flags.add_argument(
            "--threads",
            type=whole_number(),
            metavar="N",
            help="number of threads that advance one arena together, in each process "
            "(default: 1)",
        )
    add_shared(flags, *NETWORK)
    return flags
