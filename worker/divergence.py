"""Whose physics has left the realm of numbers."""

import math

import mujoco
import numpy as np

from schema.arena import Casualty
from schema.birth import BirthId
from schema.evaluation import Floats
from worker.cluster import Cluster, Seat
from worker.company import Company

FASTEST_CORE = 20.0
"""A core faster than this has broken the physics [m/s]; a fall from the thesis's
0.25 m ends at 2.2."""
_PLAUSIBLE = 1e6
"""Beyond this a coordinate or a velocity is none."""


def diverged(
    company: Company, velocities: Floats, step: int, *, looks_closely: bool
) -> list[Casualty]:
    """Return those whose physics diverged, by birth.

    In a cluster, only members whose own state tells fall; where none does, the
    engine's complaint is about all of them.

    Args:
        company: the living.
        velocities: all clusters' in a row, absolute.
        step: the arena's.
        looks_closely: the engine's warnings are read in any case.
    """
    # A sum is finite only if all its terms are, and small if all of them are.
    loud = float(velocities.max(initial=0.0))
    is_quiet = math.isfinite(loud) and loud <= FASTEST_CORE
    if is_quiet and not looks_closely:
        return _failed(company, step)
    found: list[Casualty] = []
    for cluster in company.clusters:
        reasons = {} if is_quiet else _reasons(cluster)
        complaint = cluster.failure or _warnings(cluster)
        if complaint and not reasons:
            reasons = dict.fromkeys(cluster.members, f"physics diverged: {complaint}")
        found += [
            Casualty(birth, step, reason, company.find(birth).place)
            for birth, reason in reasons.items()
        ]
    return found


def _failed(company: Company, step: int) -> list[Casualty]:
    return [
        Casualty(
            birth,
            step,
            f"physics diverged: {cluster.failure}",
            company.find(birth).place,
        )
        for cluster in company.clusters
        if cluster.failure
        for birth in cluster.members
    ]


def _reasons(cluster: Cluster) -> dict[BirthId, str]:
    reasons = {}
    for birth, seat in zip(cluster.members, cluster.seats, strict=True):
        if reason := _reason(seat):
            reasons[birth] = f"physics diverged: {reason}"
    return reasons


def _reason(seat: Seat) -> str:
    if not (np.isfinite(seat.qvel).all() and np.isfinite(seat.qpos).all()):
        return "state not finite"
    largest = max(float(np.abs(seat.qvel).max()), float(np.abs(seat.qpos).max()))
    if largest > _PLAUSIBLE:
        return f"state as large as {largest:.3g}"
    speed = math.hypot(*seat.qvel[:3].tolist())
    if speed > FASTEST_CORE:
        return f"core at {speed:.3g} m/s, more than {FASTEST_CORE:g} m/s"
    return ""


def _warnings(cluster: Cluster) -> str:
    counts = cluster.warnings
    if not counts.any():
        return ""
    return ", ".join(
        mujoco.mjtWarning(index).name.removeprefix("mjWARN_")
        for index in counts.nonzero()[0].tolist()
    )
