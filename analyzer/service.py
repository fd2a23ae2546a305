"""The analyzer on the network: one process that vets bodies until told to end."""

from analyzer.jobs import answer
from schema.agent.network import Agent
from schema.agent.service import serve_as_process
from schema.agent.supervision import ProcessSlot


def process(agent: Agent, slot: ProcessSlot) -> None:
    """Be one process of a crew of analyzers; returns when asked to end."""
    serve_as_process(answer, agent, slot)
