"""Analyzer process on the network."""

from schema.agent.network import Agent
from schema.agent.request_handler import Compute
from schema.agent.service import serve_as_process
from schema.agent.supervision import ProcessSlot


def process(compute: Compute, agent: Agent, slot: ProcessSlot) -> None:
    """Run one process of a pool of analyzers until it is asked to stop.

    ``compute``: breeds for an island and vets with ``analyzer.report``.
    """
    serve_as_process(compute, agent, slot)
