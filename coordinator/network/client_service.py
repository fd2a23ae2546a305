"""Queries to coordinators, and what a process sees at a hub: rights, round trip."""

import socket
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field
from secrets import token_hex
from uuid import uuid4

import zenoh

from schema.agent.address import UNIX, parse_address
from schema.agent.network import ASK_TIMEOUT_S, Tls, client_config
from schema.agent.service import open_session, usable, why_no_hub
from schema.agent.topics import FleetMember, Role, check_name, key_of_all, member_of
from schema.errors import MalformedMessage, NetworkError
from schema.wire.codec import encode
from schema.wire.operator import (
    GetStatus,
    OperatorReply,
    OperatorRequest,
    decode_operator_reply,
)

_NOW = zenoh.ConsolidationMode.NONE
_MOST_COORDINATORS = 1000


@contextmanager
def asking(
    connect: str, *, fleet: str, tls: Tls | None, only: str = ""
) -> Iterator[Callable[[bytes], dict[str, bytes]]]:
    """Yield what returns the replies of the coordinators at an address, by name.

    It takes an encoded ``OperatorRequest``; ``only`` is the name of the coordinator to
    query, empty queries all.

    Raises:
        NetworkError: no hub; when it is called, no coordinator replies.
    """
    config = client_config(connect, tls)
    check_name(fleet, "fleet")
    try:
        session = open_session(zenoh.Config.from_json5(config))
    except zenoh.ZError:
        raise NetworkError(why_no_hub(connect, tls)) from None

    def ask(data: bytes) -> dict[str, bytes]:
        there = coordinators(session, fleet)
        replies_of: dict[str, bytes] = {}
        for member in sorted(there, key=lambda each: each.name):
            if only in ("", member.name):
                reply = reply_of(member, session, data)
                if reply is not None:
                    replies_of[member.name] = reply
        if replies_of:
            return replies_of
        # The hub drops what a certificate may not send, without an answer.
        role = "; only an operator's certificate may ask" * connect.startswith("tls/")
        who = f"none of {len(there)} coordinators" if there else "no coordinator"
        raise NetworkError(f"{connect}: {who} of fleet {fleet} replies{role}")

    with session:
        yield ask


def coordinators(
    session: zenoh.Session, fleet: str, timeout_s: float = ASK_TIMEOUT_S
) -> set[FleetMember]:
    """Return the coordinators whose token exists, up to a limit."""
    # Not by a channel: a full one blocks the session, or loses what is not read yet.
    keys: list[str] = []
    is_done = threading.Event()

    def take(reply: zenoh.Reply) -> None:
        if reply.ok is not None and len(keys) < _MOST_COORDINATORS:
            keys.append(str(reply.ok.key_expr))

    session.liveliness().get(
        key_of_all(fleet, "coordinator", "alive"),
        zenoh.handlers.Callback(take, is_done.set, indirect=False),
        timeout=timeout_s,
    )
    is_done.wait()
    there = set()
    for key in keys:
        with suppress(MalformedMessage):
            there.add(member_of(key))
    return there


def reply_of(
    member: FleetMember,
    session: zenoh.Session,
    data: bytes,
    timeout_s: float = ASK_TIMEOUT_S,
) -> bytes | None:
    """Return a coordinator's own reply; None without one."""
    replies = session.get(
        member.command,
        payload=data,
        timeout=timeout_s,
        target=zenoh.QueryTarget.ALL,
        consolidation=_NOW,
    )
    for reply in replies:
        if reply.ok is not None and is_from(member, reply):
            return reply.ok.payload.to_bytes()
    return None


def is_from(member: FleetMember, reply: zenoh.Reply) -> bool:
    """Return whether a process's own session sent a reply; others can use its key."""
    replier = reply.replier_id
    return replier is not None and str(replier.zid) == member.session


ROLES: tuple[Role, ...] = ("worker", "analyzer", "coordinator")
_STEP_S = 1.0
_MOST_ASKED = 3


@dataclass(frozen=True, slots=True)
class HubProbe:
    """What was seen at a hub.

    Attributes:
        error: why there is no connection; empty if there is one.
        round_trip_s: time of the fastest query to the hub [s]; None: no reply.
        replies: of the first ones to a request for their status.
        malformed: names of coordinators whose replies do not decode.
        offset_s: their clock minus this machine's [s]; None without a reply.
        roles: whose keys this process may use; None: not tried, as there is no TLS.
    """

    error: str = ""
    round_trip_s: float | None = None
    coordinators: tuple[str, ...] = ()
    replies: Mapping[str, OperatorReply] = field(default_factory=dict)
    malformed: tuple[str, ...] = ()
    offset_s: float | None = None
    roles: tuple[Role, ...] | None = None


def reach(connect: str, timeout_s: float) -> str:
    """Return why a hub's address accepts no connection; empty if it does.

    ``timeout_s``: how long to wait, for the name's address included [s].
    """
    protocol, host, port = parse_address(connect)
    result = f"no answer within {timeout_s:g} s"

    def try_it() -> None:
        nonlocal result
        try:
            if protocol == UNIX:
                with socket.socket(socket.AF_UNIX) as link:
                    link.settimeout(timeout_s)
                    link.connect(host)
            else:
                socket.create_connection((host, port), timeout_s).close()
            result = ""
        except OSError as error:
            result = error.strerror or str(error)

    # The resolver of names has no timeout.
    thread = threading.Thread(target=try_it, daemon=True)
    thread.start()
    thread.join(timeout_s)
    return result


def probe(connect: str, fleet: str, tls: Tls | None, name: str) -> HubProbe:
    """Return what a process sees at a hub, within a few seconds.

    ``name``: of the certificate, or of this machine.

    Raises:
        NetworkError: an address that needs files.
    """
    config = client_config(connect, tls)
    try:
        session = open_session(zenoh.Config.from_json5(config))
    except zenoh.ZError as error:
        # What follows is a place in the engine's source.
        return HubProbe(str(error).partition(" at /")[0])
    with session:
        round_trip_s, members = _look(session, fleet)
        is_tls = connect.startswith("tls/")
        roles = _roles(session, config, fleet, name) if is_tls else None
        replies: dict[str, OperatorReply] = {}
        malformed: list[str] = []
        offset_s: float | None = None
        request = OperatorRequest(uuid4().hex, 0, GetStatus())
        until_s = time.monotonic() + _STEP_S
        for member in members[:_MOST_ASKED]:
            timeout_s = until_s - time.monotonic()
            if timeout_s <= 0.0:
                break
            asked_s = time.time()
            data = encode(request)
            reply = reply_of(member, session, data, timeout_s)
            if reply is None:
                continue
            middle_s = 0.5 * (asked_s + time.time())
            try:
                found = replies[member.name] = decode_operator_reply(reply)
            except MalformedMessage:
                malformed.append(member.name)
                continue
            if found.time_s is not None and offset_s is None:
                offset_s = found.time_s - middle_s
    names = tuple(member.name for member in members)
    return HubProbe("", round_trip_s, names, replies, tuple(malformed), offset_s, roles)


def _look(session: zenoh.Session, fleet: str) -> tuple[float | None, list[FleetMember]]:
    """Return the time of a query to the hub [s], and the coordinators there."""
    shortest_s: float | None = None
    members: set[FleetMember] = set()
    for _ in range(3):
        asked_s = time.monotonic()
        members |= coordinators(session, fleet, _STEP_S)
        elapsed_s = time.monotonic() - asked_s
        if elapsed_s >= _STEP_S:
            break  # the engine has ended the query
        shortest_s = min(elapsed_s, shortest_s or elapsed_s)
    return shortest_s, sorted(members, key=lambda member: member.name)


def _roles(
    session: zenoh.Session, config: str, fleet: str, name: str
) -> tuple[Role, ...]:
    """Return the roles whose keys a certificate may use."""
    nonce = token_hex(4)
    keys: dict[str, Role] = {}
    for role in ROLES:
        separator = "." if role == "coordinator" else "-"
        keys[FleetMember(fleet, role, f"{name}{separator}doctor-{nonce}").trial] = role
    heard = usable(keys, session, config, _STEP_S) or ()
    return tuple(role for key, role in keys.items() if key in heard)
