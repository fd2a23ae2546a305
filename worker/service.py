"""The worker on the network: one process that evaluates robots until told to end."""

from schema.network import Agent
from schema.service import serve_as_process
from worker.jobs import answer


def process(agent: Agent, index: int) -> None:
    """Be one process of a crew of workers; returns when asked to end."""
    serve_as_process(answer, agent, index)
