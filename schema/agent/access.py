"""Rights of the roles of a fleet, as rules of its hub.

Each certificate has one role and one name. An agent named ``a`` may only use keys of
processes whose names begin with ``a-``; a coordinator named ``c`` those that begin with
``c.``. What the rules do not allow, the hub drops without a message. Connections by
Unix socket, which only the hub's user can open, have all rights.
"""

from collections.abc import Iterable
from pathlib import Path
from typing import Any, Literal, NamedTuple, get_args

import msgspec

from schema.agent.address import UNIX
from schema.agent.topics import check_name
from schema.errors import NetworkError

CertificateRole = Literal["coordinator", "worker", "analyzer", "viewer", "operator"]

_ALL = (
    "put", "delete", "declare_subscriber", "query", "reply", "declare_queryable",
    "liveliness_token", "liveliness_query", "declare_liveliness_subscriber",
)  # fmt: skip
_OWN = ("put", "delete", "reply", "declare_queryable", "liveliness_token")
_SERVE = ("reply", "declare_queryable", "liveliness_token", "declare_subscriber")
_WATCH = ("liveliness_query", "declare_liveliness_subscriber")
_MOST_BYTES = 1 << 20

Flow = Literal["ingress", "egress"]


class Permission(NamedTuple):
    """Messages that a certificate may exchange with the hub.

    Attributes:
        flow: "ingress" is what the hub takes from the process, "egress" what the
            process gets.
        messages: kinds of messages, by Zenoh's names.
        keys: key expressions that include those of the messages.
    """

    flow: Flow
    messages: tuple[str, ...]
    keys: tuple[str, ...]


class Certificate(msgspec.Struct, frozen=True, forbid_unknown_fields=True):
    """A certificate that a hub accepts: its common name, and its role."""

    name: str
    role: CertificateRole


def permissions(certificate: Certificate) -> list[Permission]:
    """Return what the owner of a certificate may send and receive."""
    name = certificate.name
    agents = ("revolve/*/w/*", "revolve/*/an/*")
    coordinators = "revolve/*/co/*"
    watch = Permission("ingress", _WATCH, (f"{coordinators}/alive",))
    see = Permission("egress", ("liveliness_token",), (f"{coordinators}/alive",))
    if certificate.role in ("worker", "analyzer"):
        chunk = "w" if certificate.role == "worker" else "an"
        own = f"revolve/*/{chunk}/{name}-$*/**"
        return [
            Permission("ingress", _OWN, (own,)),
            # Coordinators subscribe to the tokens of all agents of a role.
            Permission("egress", ("query", "put", "delete"), (own,)),
            # Without these a publisher finds no subscriber.
            Permission(
                "egress",
                ("declare_subscriber", "declare_liveliness_subscriber"),
                (f"revolve/*/{chunk}/**",),
            ),
            Permission("ingress", ("declare_subscriber",), (own,)),
            watch,
            see,
        ]
    if certificate.role == "coordinator":
        own = f"revolve/*/co/{name}.$*/**"
        migrants, announced = (
            (f"{coordinators}/migrants",),
            (f"{coordinators}/announced",),
        )
        return [
            Permission("ingress", (*_OWN, "declare_subscriber"), (own,)),
            Permission("ingress", _WATCH, tuple(f"{each}/alive" for each in agents)),
            Permission(
                "ingress",
                ("query",),
                tuple(f"{each}/{key}" for each in agents for key in ("jobs", "info")),
            ),
            Permission(
                "ingress", ("put",), tuple(f"{each}/cancelled" for each in agents)
            ),
            Permission("egress", _SERVE, ("revolve/*/w/**", "revolve/*/an/**")),
            Permission("egress", ("query", "put", "delete"), (own,)),
            # Groups of islands: any coordinator may ask, and each checks requests.
            Permission("ingress", ("query",), migrants),
            Permission("egress", ("query", "reply", "declare_queryable"), migrants),
            Permission("ingress", ("declare_subscriber",), announced),
            Permission("egress", ("put",), announced),
            Permission("egress", ("declare_subscriber",), (f"{coordinators}/**",)),
            watch,
            see,
        ]
    asks = [f"{coordinators}/state"]
    if certificate.role == "operator":
        asks.append(f"{coordinators}/command")
    news = (f"{coordinators}/events", "revolve/*/w/*/arena/*/pose")
    return [
        Permission("ingress", ("query",), tuple(asks)),
        Permission("egress", ("reply", "declare_queryable"), tuple(asks)),
        Permission("ingress", ("declare_subscriber",), news),
        Permission("egress", ("put", "delete"), news),
        watch,
        see,
    ]


def access_control(certificates: Iterable[Certificate]) -> dict[str, Any]:
    """Return Zenoh's configuration ``access_control``: what is not listed is denied.

    Raises:
        NetworkError: an invalid name, or one that includes another's keys.
    """
    known = list(certificates)
    check_certificates(known)
    everything = [Permission(flow, _ALL, ("**",)) for flow in get_args(Flow)]
    rights: list[tuple[dict[str, Any], list[Permission]]] = [
        ({"id": "socket", "link_protocols": [UNIX]}, everything)
    ]
    for certificate in known:
        name = f"{certificate.role} {certificate.name}"
        subject = {"id": name, "cert_common_names": [certificate.name]}
        rights.append((subject, permissions(certificate)))
    rules: list[dict[str, Any]] = []
    policies = []
    for subject, allowed in rights:
        own = [
            {
                "id": f"{subject['id']} {number}",
                "permission": "allow",
                "flows": [each.flow],
                "messages": each.messages,
                "key_exprs": each.keys,
            }
            for number, each in enumerate(allowed)
        ]
        rules += own
        ids = [rule["id"] for rule in own]
        policies.append({"rules": ids, "subjects": [subject["id"]]})
    return {
        "enabled": True,
        "default_permission": "deny",
        "rules": rules,
        "subjects": [subject for subject, _ in rights],
        "policies": policies,
    }


def check_certificates(certificates: Iterable[Certificate]) -> None:
    """Check that each certificate's keys are its own.

    Raises:
        NetworkError: an invalid name, one that is there twice, or one that includes
            another's keys.
    """
    known: list[str] = []
    for certificate in certificates:
        name = check_name(certificate.name, "name of a certificate")
        for other in known:
            if name == other:
                raise NetworkError(f"{name!r}: two certificates have this name")
            short, long = sorted((name, other), key=len)
            if long.startswith((f"{short}-", f"{short}.")):
                raise NetworkError(
                    f"{long!r} would have the keys of {short!r}: names must not begin "
                    f"with another name and '-' or '.'"
                )
        known.append(name)


def read_certificates(file: Path) -> list[Certificate]:
    """Return the certificates that a file lists, for ``--access``.

    Raises:
        NetworkError: the file cannot be read, is damaged, or names are invalid.
    """
    try:
        with file.open("rb") as source:
            data = source.read(_MOST_BYTES)
        # A longer file is cut, so that it does not decode.
        certificates = msgspec.json.decode(data, type=list[Certificate])
        check_certificates(certificates)
    except OSError as error:
        raise NetworkError(f"{file}: cannot be read: {error.strerror}") from None
    except (ValueError, RecursionError, NetworkError) as error:
        raise NetworkError(
            f"{file}: must be a JSON list of objects with name and role: {error}"
        ) from None
    return certificates
