"""Queries to coordinators: for operators and for the status command."""

from contextlib import suppress
from threading import Event

import zenoh

from schema.agent.network import ASK_TIMEOUT_S, DEFAULT_FLEET, Tls, client_config
from schema.agent.service import open_session, why_no_hub
from schema.agent.topics import Member, agents_alive, check_name, member_of
from schema.errors import MalformedMessage, NetworkError

_NOW = zenoh.ConsolidationMode.NONE
_MOST_COORDINATORS = 1000


def ask_coordinators(
    data: bytes,
    *,
    connect: str,
    fleet: str = DEFAULT_FLEET,
    tls: Tls | None = None,
    only: str = "",
) -> dict[str, bytes]:
    """Return the replies of the coordinators at an address, by name.

    ``data``: an encoded ``OperatorRequest``. ``only``: name of the coordinator to
    query; empty queries all.

    Raises:
        NetworkError: no hub, or no coordinator replies.
    """
    config = client_config(connect, tls)
    check_name(fleet, "fleet")
    try:
        session = open_session(zenoh.Config.from_json5(config))
    except zenoh.ZError:
        raise NetworkError(why_no_hub(connect, tls)) from None
    replies_of: dict[str, bytes] = {}
    with session:
        there = coordinators(session, fleet)
        for member in sorted(there, key=lambda each: each.name):
            if only in ("", member.name):
                reply = reply_of(member, session, data)
                if reply is not None:
                    replies_of[member.name] = reply
    if not replies_of:
        # The hub drops what a certificate may not send, without an answer.
        role = "; only an operator's certificate may ask" * connect.startswith("tls/")
        who = f"none of {len(there)} coordinators" if there else "no coordinator"
        raise NetworkError(f"{connect}: {who} of fleet {fleet} replies{role}")
    return replies_of


def coordinators(
    session: zenoh.Session, fleet: str, timeout_s: float = ASK_TIMEOUT_S
) -> set[Member]:
    """Return the coordinators whose token exists, up to a limit."""
    # Not by a channel: a full one blocks the session, or loses what is not read yet.
    keys: list[str] = []
    is_done = Event()

    def take(reply: zenoh.Reply) -> None:
        if reply.ok is not None and len(keys) < _MOST_COORDINATORS:
            keys.append(str(reply.ok.key_expr))

    session.liveliness().get(
        agents_alive(fleet, "coordinator"),
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
    member: Member,
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
        replier = reply.replier_id
        is_own = replier is not None and str(replier.zid) == member.session
        if is_own and reply.ok is not None:
            return reply.ok.payload.to_bytes()
    return None
