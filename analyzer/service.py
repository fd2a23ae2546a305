"""Analyzer process on the network."""

from analyzer.report import answer
from schema.agent.network import Agent
from schema.agent.service import serve_as_process
from schema.agent.supervision import ProcessSlot


def process(agent: Agent, slot: ProcessSlot) -> None:
    """Run one process of a pool of analyzers until it is asked to stop."""
    serve_as_process(answer, agent, slot)
