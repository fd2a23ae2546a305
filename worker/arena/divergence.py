"""Whose physics has left the realm of numbers."""

import math

import mujoco
import numpy as np

from schema.robot.ids import BirthId
from schema.robot.results import Floats
from schema.wire.arena import Casualty
from worker.clusters.cluster import Cluster
from worker.clusters.population import ArenaPopulation
from worker.clusters.rollout import PLAUSIBLE, Rollout

FASTEST_CORE = 20.0
"""A core faster than this has broken the physics [m/s]; a fall from the thesis's
0.25 m ends at 2.2."""


def diverged(
    population: ArenaPopulation, rollout: Rollout, step: int, *, looks_closely: bool
) -> list[Casualty]:
    """Return those whose physics diverged, by birth.

    In a cluster, only members whose own state tells fall; where none does, the
    engine's complaint is about all of them.

    Args:
        population: the living.
        rollout: what they did, and which moment of it is looked at.
        step: the arena's.
        looks_closely: the engine's warnings are read in any case.
    """
    is_quiet = _is_quiet(rollout.loudest)
    if not is_quiet:
        velocities = np.abs(rollout.state[population.layout.velocities])
        is_quiet = _is_quiet(float(velocities.max(initial=0.0)))
    if is_quiet and not looks_closely and not rollout.has_failures:
        return []
    moment = rollout.moment
    found: list[Casualty] = []
    for cluster in population.clusters:
        reasons, complaint = {}, ""
        if cluster.failed_at <= moment:
            complaint = cluster.failure
        if looks_closely or not is_quiet:
            reasons = {} if is_quiet else _reasons(cluster, moment)
            complaint = complaint or _warnings(cluster, moment)
        if complaint and not reasons:
            reasons = dict.fromkeys(cluster.members, f"physics diverged: {complaint}")
        found += [
            Casualty(birth, step, reason, population.find(birth).place)
            for birth, reason in reasons.items()
        ]
    return found


def _is_quiet(loudest: float) -> bool:
    """Return whether the greatest of all velocities tells that nobody diverged."""
    return math.isfinite(loudest) and loudest <= FASTEST_CORE


def _reasons(cluster: Cluster, moment: int) -> dict[BirthId, str]:
    reasons = {}
    track = cluster.track
    for birth, view in zip(cluster.members, cluster.views, strict=True):
        positions = track.qpos[moment, view.joints : view.joints + len(view.qpos)]
        velocities = track.qvel[moment, view.dofs : view.dofs + len(view.qvel)]
        if reason := _reason(positions, velocities):
            reasons[birth] = f"physics diverged: {reason}"
    return reasons


def _reason(positions: Floats, velocities: Floats) -> str:
    if not (np.isfinite(velocities).all() and np.isfinite(positions).all()):
        return "state not finite"
    largest = max(float(np.abs(velocities).max()), float(np.abs(positions).max()))
    if largest > PLAUSIBLE:
        return f"state as large as {largest:.3g}"
    speed = math.hypot(*velocities[:3].tolist())
    if speed > FASTEST_CORE:
        return f"core at {speed:.3g} m/s, more than {FASTEST_CORE:g} m/s"
    return ""


def _warnings(cluster: Cluster, moment: int) -> str:
    counts = cluster.track.warnings[moment]
    if not counts.any():
        return ""
    return ", ".join(
        mujoco.mjtWarning(index).name.removeprefix("mjWARN_")
        for index in counts.nonzero()[0].tolist()
    )
