"""Answers of agents that many tests of the coordinator give."""

from schema.robot.results import Provenance

PROVENANCE = Provenance("worker-1", "x86", 0.5)
