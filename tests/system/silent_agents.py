"""Agents that join, take jobs and never answer."""

from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from typing import Any, Literal

import zenoh

from schema.agent.network import client_config
from schema.agent.service import session_config
from schema.agent.topics import Member
from tests.system.introduction import introduce


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
