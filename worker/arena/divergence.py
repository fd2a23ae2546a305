"""Detection of robots whose physics diverged."""

import math

import numpy as np

from schema.robot.ids import BirthId
from schema.robot.results import Floats
from schema.wire.arena import Casualty
from worker.clusters.cluster import Cluster
from worker.clusters.population import ArenaPopulation
from worker.clusters.rollout import PLAUSIBLE, Rollout
from worker.robot.evaluation import warning_names

FASTEST_CORE = 20.0
"""Core speed above which the physics is broken [m/s]; a fall from the thesis's
0.25 m ends at 2.2."""


def diverged(
    population: ArenaPopulation, rollout: Rollout, step: int, *, reads_warnings: bool
) -> list[Casualty]:
    """Return the robots whose physics diverged, by birth.

    In a cluster, only members whose own state is implausible are lost. If there is
    none, an error or a warning of the engine removes all members.

    Args:
        population: the living robots.
        rollout: their states, at the present moment.
        step: of the arena.
        reads_warnings: read the engine's warnings even if all states are plausible.
    """
    is_plausible = _is_plausible(rollout.max_velocity)
    if not is_plausible:
        velocities = np.abs(rollout.state[population.layout.velocities])
        is_plausible = _is_plausible(float(velocities.max(initial=0.0)))
    if is_plausible and not reads_warnings and not rollout.has_failures:
        return []
    moment = rollout.moment
    found: list[Casualty] = []
    for cluster in population.clusters:
        reasons, problem = {}, ""
        if cluster.failed_at <= moment:
            problem = cluster.failure
        if reads_warnings or not is_plausible:
            reasons = {} if is_plausible else _reasons(cluster, moment)
            problem = problem or warning_names(cluster.history.warnings[moment])
        if problem and not reasons:
            reasons = dict.fromkeys(cluster.members, f"physics diverged: {problem}")
        found += [
            Casualty(birth, step, reason, population.find(birth).place)
            for birth, reason in reasons.items()
        ]
    return found


def _is_plausible(max_velocity: float) -> bool:
    return math.isfinite(max_velocity) and max_velocity <= FASTEST_CORE


def _reasons(cluster: Cluster, moment: int) -> dict[BirthId, str]:
    reasons = {}
    history = cluster.history
    for birth, view in zip(cluster.members, cluster.views, strict=True):
        positions = history.qpos[moment, view.joints]
        velocities = history.qvel[moment, view.dofs]
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
