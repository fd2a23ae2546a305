"""Queries to coordinators: for operators and for the status command."""

import zenoh

from schema.agent.network import ASK_TIMEOUT_S, DEFAULT_FLEET, Tls, client_config
from schema.agent.topics import agents_alive, check_name, member_of
from schema.errors import NetworkError

_NOW = zenoh.ConsolidationMode.NONE


def ask_coordinators(
    data: bytes,
    *,
    connect: str,
    fleet: str = DEFAULT_FLEET,
    tls: Tls | None = None,
    only: str = "",
) -> dict[str, bytes]:
    """Return the replies of the coordinators at an address, by name.

    Args:
        data: an encoded ``OperatorRequest``.
        connect: address of the hub.
        fleet: name of the fleet.
        tls: files, for a ``tls/`` address.
        only: name of the coordinator to query; empty queries all.

    Raises:
        NetworkError: no hub, or no coordinator replies.
    """
    config = client_config(connect, tls)
    check_name(fleet, "fleet")
    zenoh.init_log_from_env_or("error")
    try:
        session = zenoh.open(zenoh.Config.from_json5(config))
    except zenoh.ZError:
        raise NetworkError(f"no coordinator at {connect}") from None
    replies_of: dict[str, bytes] = {}
    with session:
        tokens = session.liveliness().get(agents_alive(fleet, "coordinator"))
        there = [member_of(str(each.ok.key_expr)) for each in tokens if each.ok]
        for member in sorted(there, key=lambda each: each.name):
            if only not in ("", member.name):
                continue
            replies = session.get(
                member.command,
                payload=data,
                timeout=ASK_TIMEOUT_S,
                consolidation=_NOW,
            )
            for reply in replies:
                if reply.ok is not None:
                    replies_of[member.name] = reply.ok.payload.to_bytes()
    if not replies_of:
        raise NetworkError(
            f"{connect}: none of {len(there)} coordinators of fleet {fleet} replies"
        )
    return replies_of
