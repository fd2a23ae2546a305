"""Answers of agents that many tests of the coordinator give."""

from schema.robot.results import Provenance, Report

ORIGIN = (0.0, 0.0, 0.0)
VIABLE = Report(
    is_viable=True, reason="", intersections=(), lower=ORIGIN, upper=ORIGIN,
    mass=0.1, motors=1,
)  # fmt: skip
CROWDED = Report(
    is_viable=False, reason="parts 1 and 2 intersect", intersections=((1, 2),),
    lower=ORIGIN, upper=ORIGIN, mass=0.1, motors=1,
)  # fmt: skip
PROVENANCE = Provenance("worker-1", "x86", 0.5)
