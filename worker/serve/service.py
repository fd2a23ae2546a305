"""Worker process on the network."""

from functools import lru_cache

from schema.agent.network import Agent
from schema.agent.service import Outlet, own_agent, serve_as_process
from schema.agent.supervision import ProcessSlot
from schema.agent.topics import FleetMember
from schema.tables.arrow import skip_pandas
from worker.arena.world import World
from worker.serve.jobs import Jobs
from worker.serve.shards import Shards


def process(agent: Agent, slot: ProcessSlot) -> None:
    """Run one process of a worker; returns when asked to stop."""
    own = own_agent(agent, slot.index)
    member = FleetMember(own.fleet, own.role, own.name)
    outlet = Outlet()
    skip_pandas()
    shards = Shards(
        World,
        most_held=own.shards,
        threads=own.threads,
        outlet=outlet,
        key_of=lru_cache(member.poses),
    )
    serve_as_process(Jobs(shards).answer, own, slot, outlet)
