"""How the processes of a fleet find each other, as Zenoh configurations.

One hub, everybody else a client with one explicit address. No discovery, and
nothing listens beyond this machine unless certificates guard it.
"""

import json
import re
from dataclasses import dataclass
from ipaddress import ip_address
from typing import Any

from schema.agent.supervision import CPU_LIMIT_S
from schema.agent.topics import Role
from schema.errors import NetworkError

# Port 0: whichever is free.
THIS_MACHINE = "tcp/127.0.0.1:0"
DEFAULT_FLEET = "default"

# How an agent's refusal begins if a newer coordinator has taken the run over.
FENCED = "fenced: "
# And if it cannot do any job of the run, for want of the run's plug-ins.
UNFIT = "unfit: "
# No clock of ours ends a job: a week is longer than any [s].
JOB_TIMEOUT_S = 7 * 24 * 3600.0
ASK_TIMEOUT_S = 10.0
# A frozen process counts as gone after this [ms].
LEASE_MS = 5000

_ADDRESS = re.compile(r"(tcp|tls)/(\[[0-9a-fA-F:.]+\]|[A-Za-z0-9._-]+):(\d{1,5})")
_LAST_PORT = 65535


@dataclass(frozen=True, slots=True)
class Tls:
    """Files (PEM) with which a process proves who it is and checks the others.

    Attributes:
        ca: certificate of the authority that signed all of a fleet.
        certificate: own certificate.
        key: own private key (PKCS#8).
    """

    ca: str
    certificate: str
    key: str


@dataclass(frozen=True, slots=True)
class Agent:
    """One that does jobs, and where its hub is.

    Attributes:
        role: "worker" or "analyzer".
        name: never used again by another process.
        connect: address of the hub.
        fleet: name of the fleet.
        slots: jobs at a time; one process does one.
        tls: files, for a ``tls/`` address.
        platform: tag of CPU, system and libraries.
        version: of Revolve Islands.
        threads: that advance one arena together.
        cpu_limit_s: CPU time of a job after which it counts as one that hangs [s].
    """

    role: Role
    name: str
    connect: str
    fleet: str = DEFAULT_FLEET
    slots: int = 1
    tls: Tls | None = None
    platform: str = ""
    version: str = ""
    threads: int = 1
    cpu_limit_s: float = CPU_LIMIT_S


def parse_address(address: str) -> tuple[str, str, int]:
    """Return protocol, host and port of an address.

    Raises:
        NetworkError: not of the form ``tcp/host:port`` or ``tls/host:port``.
    """
    match = _ADDRESS.fullmatch(address)
    if match is None or int(match[3]) > _LAST_PORT:
        raise NetworkError(
            f"an address must be tcp/HOST:PORT or tls/HOST:PORT, got {address!r}"
        )
    return match[1], match[2].strip("[]"), int(match[3])


def _is_loopback(host: str) -> bool:
    if host == "localhost":
        return True
    try:
        return ip_address(host).is_loopback
    except ValueError:
        return False


def _check_tls(address: str, protocol: str, tls: Tls | None) -> None:
    if protocol == "tls" and tls is None:
        raise NetworkError(f"{address} needs --tls-ca, --tls-certificate and --tls-key")


def hub_config(listen: tuple[str, ...], tls: Tls | None = None) -> str:
    """Return the configuration (JSON5) of a hub within a process.

    Args:
        listen: addresses; one at least.
        tls: files for the ``tls/`` ones among them.

    Raises:
        NetworkError: no address; one that is none, that is reached from beyond
            this machine without TLS, or that needs files.
    """
    protocols = set()
    if not listen:
        raise NetworkError("a hub must listen on one address at least, got none")
    for address in listen:
        protocol, host, _ = parse_address(address)
        _check_tls(address, protocol, tls)
        if protocol == "tcp" and not _is_loopback(host):
            raise NetworkError(
                f"{address} would listen beyond this machine without protection: "
                "use tls/HOST:PORT with --tls-ca, --tls-certificate and --tls-key"
            )
        protocols.add(protocol)
    if "tls" in protocols and any(parse_address(a)[2] == 0 for a in listen):
        raise NetworkError("with a tls/ address each address needs a port, got 0")
    link = _link(protocols)
    if tls and "tls" in protocols:
        link["tls"] = {
            "root_ca_certificate": tls.ca,
            "listen_certificate": tls.certificate,
            "listen_private_key": tls.key,
            "enable_mtls": True,
            "close_link_on_expiration": True,
        }
    config = _common(link)
    config["mode"] = "router"
    config["listen"] = {"endpoints": list(listen), "exit_on_failure": True}
    config["connect"] = {"endpoints": []}
    # Only on this machine: tells which port was free.
    config["adminspace"] = {
        "enabled": protocols == {"tcp"},
        "permissions": {"read": True, "write": False},
    }
    config["transport"]["unicast"] = {"max_sessions": 10000, "accept_pending": 1000}
    return json.dumps(config)


def client_config(connect: str, tls: Tls | None = None) -> str:
    """Return the configuration (JSON5) of everybody who is not the hub.

    Raises:
        NetworkError: no address, or one that needs files.
    """
    protocol, _, _ = parse_address(connect)
    _check_tls(connect, protocol, tls)
    link = _link({protocol})
    if tls and protocol == "tls":
        link["tls"] = {
            "root_ca_certificate": tls.ca,
            "connect_certificate": tls.certificate,
            "connect_private_key": tls.key,
            "enable_mtls": True,
            "verify_name_on_connect": True,
        }
    config = _common(link)
    config["mode"] = "client"
    config["listen"] = {"endpoints": []}
    config["connect"] = {
        "endpoints": [connect],
        "timeout_ms": 2000,
        "retry": {
            "period_init_ms": 250,
            "period_max_ms": 1000,
            "period_increase_factor": 2,
        },
    }
    return json.dumps(config)


def _link(protocols: set[str]) -> dict[str, Any]:
    return {
        "protocols": sorted(protocols),
        "tx": {"lease": LEASE_MS, "keep_alive": 4},
    }


def _common(link: dict[str, Any]) -> dict[str, Any]:
    """Return what hub and clients share: no discovery, no shared memory."""
    return {
        "scouting": {
            "multicast": {"enabled": False},
            "gossip": {"enabled": False},
            "delay": 0,
        },
        "queries_default_timeout": 60000,
        "transport": {"shared_memory": {"enabled": False}, "link": link},
    }
