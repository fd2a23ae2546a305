"""Zenoh connection to agents, operators and viewers; an in-process substitute."""
