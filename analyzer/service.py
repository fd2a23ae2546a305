"""The analyzer on the network: one process that vets bodies until told to end."""

from analyzer.jobs import answer
from schema.network import Agent
from schema.service import serve_as_process


def process(agent: Agent, index: int) -> None:
    """Be one process of a crew of analyzers; returns when asked to end."""
    serve_as_process(answer, agent, index)
