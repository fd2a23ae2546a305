"""Zenoh configurations of the processes of a fleet.

One process is the hub; all others are clients with its explicit address. There is no
discovery, and only addresses with certificates are reachable from other machines.
"""

import json
import math
from collections.abc import Iterable
from dataclasses import dataclass
from ipaddress import ip_address
from typing import Any

from schema.agent.access import Certificate, access_control
from schema.agent.address import UNIX, parse_address
from schema.agent.supervision import CPU_LIMIT_S, WAIT_LIMIT_S
from schema.agent.topics import Role
from schema.errors import NetworkError

DEFAULT_FLEET = "default"

# Prefix of an agent's refusal if a newer coordinator has taken the run over.
FENCED = "fenced: "
# Reply for a job that its coordinator has cancelled.
CANCELLED = "the job was cancelled"
# Prefix of a refusal if the agent lacks the plug-ins of the run.
UNFIT = "unfit: "
ASK_TIMEOUT_S = 10.0
# Messages for viewers come in bursts, and are dropped if they do not fit.
_QUEUE = {"size": {"data_low": 16}}
# Limits of a hub for viewers' requests: length [bytes], rate of a connection [1/s]; and
# a reply that its viewer does not read is dropped, or the coordinator would wait.
_STATES = "revolve/*/co/*/state"
_REQUESTS: dict[str, Any] = {"messages": ["query"], "flows": ["ingress"]}
_OF_STATES = {**_REQUESTS, "key_exprs": [_STATES]}
_DROP = {"congestion_control": "drop", "priority": "data_low"}
_VIEWER_LIMITS = {
    "low_pass_filter": [{**_OF_STATES, "size_limit": 64}],
    "downsampling": [{**_REQUESTS, "rules": [{"key_expr": _STATES, "freq": 10.0}]}],
    "qos": {"network": [{**_OF_STATES, "overwrite": _DROP}]},
}
# A frozen process counts as gone after this [ms].
LEASE_MS = 5000


@dataclass(frozen=True, slots=True)
class Tls:
    """Files (PEM) with which a process authenticates itself and checks the others.

    Attributes:
        ca: certificate of the authority that signed all certificates of a fleet.
        key: own private key (PKCS#8).
    """

    ca: str
    certificate: str
    key: str


@dataclass(frozen=True, slots=True)
class Agent:
    """A process that does jobs, and the address of its hub.

    Attributes:
        name: never used by another process.
        slots: jobs at a time; one process does one.
        platform: tag of CPU, system and libraries.
        threads: that advance one arena together.
        wait_limit_s: time that a job may wait without using CPU time [s].
        processes: that share the memory of this machine.
        shards: arenas whose state the process keeps.
        plugins: modules and files that it may import, for ``permission.allow``.
        give_up_after_s: time without a hub after which the process ends [s].
        tells_hub: say that the hub is there the first time, too.
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
    wait_limit_s: float = WAIT_LIMIT_S
    processes: int = 1
    shards: int = 1
    plugins: tuple[str, ...] = ()
    give_up_after_s: float = math.inf
    tells_hub: bool = False


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


def hub_config(
    listen: tuple[str, ...],
    tls: Tls | None = None,
    certificates: Iterable[Certificate] | None = None,
) -> str:
    """Return the configuration (JSON5) of a hub, within a process or for zenohd.

    It listens on one address at least. The owners of the certificates may connect, each
    with the rights of its role; None: every certificate of the authority has all
    rights.

    Raises:
        NetworkError: no address, an invalid one, one that other machines reach without
            TLS, one that needs files, or names of certificates that clash.
    """
    if not listen:
        raise NetworkError("a hub must listen on one address at least, got none")
    places = list(map(parse_address, listen))
    protocols = {place.protocol for place in places}
    for address, (protocol, host, _) in zip(listen, places, strict=True):
        _check_tls(address, protocol, tls)
        if protocol == "tcp" and not _is_loopback(host):
            raise NetworkError(
                f"{address} would listen beyond this machine without protection: "
                "use tls/HOST:PORT with --tls-ca, --tls-certificate and --tls-key"
            )
    has_open_port = any(each.protocol != UNIX and each.port == 0 for each in places)
    if "tls" in protocols and has_open_port:
        raise NetworkError("with a tls/ address each address needs a port, got 0")
    config = _common(protocols, tls, "listen", close_link_on_expiration=True)
    config["mode"] = "router"
    config["listen"] = {"endpoints": list(listen), "exit_on_failure": True}
    config["connect"] = {"endpoints": []}
    config |= _VIEWER_LIMITS
    if certificates is not None:
        config["access_control"] = access_control(certificates)
    # Only on this machine: reports the port that was chosen.
    config["adminspace"] = {
        "enabled": "tls" not in protocols,
        "permissions": {"read": True, "write": False},
    }
    config["transport"]["unicast"] = {"max_sessions": 10000, "accept_pending": 1000}
    return json.dumps(config)


def cannot_listen(address: str, error: str) -> NetworkError:
    """Return the error for an address that a hub cannot listen on."""
    if "in use" in error or "acquire lock" in error:
        why = f"it is in use; to share its workers: --connect {address}"
    else:
        why = error.partition(" at /")[0].strip()
    return NetworkError(f"cannot listen on {address}: {why}")


def client_config(connect: str, tls: Tls | None = None) -> str:
    """Return the configuration (JSON5) of a client.

    Raises:
        NetworkError: an invalid address, or one that needs files.
    """
    protocol, _, _ = parse_address(connect)
    _check_tls(connect, protocol, tls)
    config = _common({protocol}, tls, "connect", verify_name_on_connect=True)
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


def _common(
    protocols: set[str], tls: Tls | None, side: str, **checks: bool
) -> dict[str, Any]:
    """Return the settings of hub and clients: no discovery, no shared memory."""
    link: dict[str, Any] = {
        "protocols": sorted(protocols),
        "tx": {"lease": LEASE_MS, "keep_alive": 4, "queue": _QUEUE},
    }
    if tls and "tls" in protocols:
        link["tls"] = {
            "root_ca_certificate": tls.ca,
            f"{side}_certificate": tls.certificate,
            f"{side}_private_key": tls.key,
            "enable_mtls": True,
            **checks,
        }
    return {
        "scouting": {
            "multicast": {"enabled": False},
            "gossip": {"enabled": False},
            "delay": 0,
        },
        "queries_default_timeout": 60000,
        "transport": {"shared_memory": {"enabled": False}, "link": link},
    }
