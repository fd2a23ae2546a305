"""Agents that tests make up: they introduce themselves, take jobs, never answer."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any, Literal

import zenoh

from schema.agent.network import client_config
from schema.agent.platform_tag import platform_tag, wire_version
from schema.agent.service import session_config
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


@contextmanager
def silent_agents(
    address: str, count: int, role: Literal["worker", "analyzer"] = "worker"
) -> Iterator[list[zenoh.Query]]:
    """Let silent agents join at a hub; return the list of the jobs that they take.

    Their names come before those of honest agents. They reply when they are asked for
    their properties, as an agent does whose job hangs.
    """
    taken: list[zenoh.Query] = []
    with ExitStack() as stack:
        for number in range(count):
            member = Member("default", role, f"a-silent-{role}-{number}")
            config = session_config(client_config(address), member)
            session = stack.enter_context(zenoh.open(config))
            on_job: Any = zenoh.handlers.Callback(taken.append, indirect=False)
            stack.enter_context(
                session.declare_queryable(member.jobs, on_job, complete=True)
            )
            stack.enter_context(introduce(session, member))
            stack.enter_context(session.liveliness().declare_token(member.alive))
        yield taken
