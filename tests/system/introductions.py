"""Processes as their tokens show them, and what a good agent says of itself."""

from typing import Any

import zenoh

from schema.agent.platform_tag import platform_tag, wire_version
from schema.agent.topics import Member, Role, agents_alive, member_of
from schema.wire.codec import encode
from schema.wire.messages import AgentInfo, Crash


def alive(session: zenoh.Session, role: Role) -> list[Member]:
    """Return the processes of a role whose tokens a session may see, by name."""
    tokens = session.liveliness().get(agents_alive("default", role), timeout=2.0)
    members = [member_of(str(each.ok.key_expr)) for each in tokens if each.ok]
    return sorted(members, key=lambda member: member.name)


def introduce(session: zenoh.Session, member: Member, *deaths: Crash) -> Any:  # noqa: ANN401 - of Zenoh
    """Declare a queryable that says what a good agent of this machine says.

    Returns:
        The queryable, which ends with its session or with the last reference to it.
    """
    info = encode(
        AgentInfo(
            agent=member.name,
            kind=member.role,
            slots=1,
            platform=platform_tag(),
            version=wire_version(),
            deaths=deaths,
            shards=8,
        )
    )

    def tell(query: zenoh.Query) -> None:
        with query:
            query.reply(member.info, info)

    told = zenoh.handlers.Callback(tell)
    return session.declare_queryable(member.info, told, complete=True)
