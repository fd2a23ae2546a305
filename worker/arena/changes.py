"""Changes of an arena's robots: insertions, checks of changes, losses to divergence."""

import math
from collections.abc import Collection

import mujoco
import numpy as np

from schema.errors import SimulationDiverged, UnexpectedEvent, one_line
from schema.experiment.document import body_space
from schema.robot.ids import BirthId
from schema.robot.robot import Robot, check_robot
from schema.robot.trace import Floats
from schema.wire.arena import Casualty, Changes, Insertion
from worker.clusters.cluster import Cluster
from worker.clusters.population import ArenaPopulation
from worker.clusters.robot import ArenaRobot, FitnessWindow
from worker.clusters.states import PLAUSIBLE, Rollout
from worker.robot.placed import warning_names

FASTEST_CORE = 20.0
"""Core speed above which the physics is broken [m/s]; a fall from the thesis's
0.25 m ends at 2.2."""
_CALM = FASTEST_CORE / math.sqrt(3.0)
"""A core is not faster than ``FASTEST_CORE`` if no velocity is greater than this."""


def check_changes(changes: Changes, population: ArenaPopulation, step: int) -> None:
    """Raise, as ``World.apply``, unless changes can be made to a population."""
    gone = _distinct(changes.removals)
    new = _distinct(tuple(insertion.birth for insertion in changes.insertions))
    _distinct(tuple(change.birth for change in changes.brains))
    for birth in gone:
        if birth not in population:
            raise UnexpectedEvent(f"apply: {birth} does not live here")
    for birth in new:
        if birth in population and birth not in gone:
            raise UnexpectedEvent(f"apply: {birth} lives here already")
    settings = population.model_cache.settings
    tick, sample = settings.simulation.brain_steps, settings.simulation.pose_steps
    if step % sample and any(change.restarts_window for change in changes.brains):
        raise UnexpectedEvent(
            "apply: windows must restart on multiples of simulation.pose_steps = "
            f"{sample}, got step {step}"
        )
    if new and step % tick:
        raise UnexpectedEvent(
            "apply: births must fall on multiples of simulation.brain_steps = "
            f"{tick}, got step {step}"
        )
    robots = {insertion.birth: insertion.robot for insertion in changes.insertions}
    for change in changes.brains:
        birth = change.birth
        if birth not in new and (birth in gone or birth not in population):
            raise UnexpectedEvent(f"apply: {birth} does not live here")
        body = robots[birth] if birth in new else population.find(birth).body.robot
        robots[birth] = Robot(body.parts, change.brain)
    controls = population.model_cache.controls
    for robot in robots.values():
        check_robot(robot, body_space(settings.space), controls.neurons)
        controls.check(robot.brain)


def possible(changes: Changes, living: Collection[BirthId]) -> Changes:
    """Return the part of changes from another platform that is possible here.

    A robot that died only on this platform is not removed again. A robot that died only
    on the other platform, and returns as a migrant, is removed first. If the same
    robots are alive on both, the changes are the same.
    """
    coming = [each.birth for each in changes.insertions]
    going = dict.fromkeys((*changes.removals, *coming))
    return Changes(
        tuple(birth for birth in going if birth in living),
        changes.insertions,
        tuple(
            change
            for change in changes.brains
            if change.birth in living or change.birth in coming
        ),
        changes.lights,
    )


def newborn(
    insertion: Insertion, population: ArenaPopulation, step: int
) -> ArenaRobot | Casualty:
    """Return a robot at its place with its first readings, or a casualty.

    The caller adds the first sample to its window.

    Raises:
        ExperimentError: a sensor that has no stimulus in the arena.
    """
    cache, (x, y) = population.model_cache, insertion.place
    try:
        body = cache.body(insertion.birth, insertion.robot)
    except ValueError as error:
        reason = f"cannot be built: {one_line(error)}"
        return Casualty(insertion.birth, step, reason, (x, y, 0.0))
    view, half = body.solo.views[0], 0.5 * insertion.heading
    place = (x, y, cache.height(body, insertion.place, insertion.heading))
    view.qpos[:3] = place
    if half:
        view.qpos[3:7] = np.cos(half), 0.0, 0.0, np.sin(half)
    try:
        view.sensors.start()
    except mujoco.FatalError as error:
        reason = f"physics diverged: {one_line(error)}"
        return Casualty(insertion.birth, step, reason, place)
    window = FitnessWindow(cache.settings.simulation, step)
    try:
        return ArenaRobot(insertion.birth, body, cache.controls, window, place)
    except SimulationDiverged as error:
        return Casualty(insertion.birth, step, str(error), place)


def diverged(
    population: ArenaPopulation, rollout: Rollout, step: int, *, reads_warnings: bool
) -> list[Casualty]:
    """Return the robots whose physics diverged.

    Each cluster decides for itself. Only members whose own state is implausible are
    lost. If there is none, an error or a warning of the engine removes all members;
    without ``reads_warnings``, warnings count only beside a great velocity.
    """
    moment, are_calm = rollout.moment, rollout.max_velocity <= _CALM
    if are_calm and not reads_warnings and not rollout.has_failures:
        return []
    found: list[Casualty] = []
    for cluster in population.clusters:
        problem = cluster.failure if cluster.failed_at <= moment else ""
        history, reasons = cluster.history, dict[BirthId, str]()
        is_calm = are_calm or bool(np.abs(history.qvel[moment]).max() <= _CALM)
        if reads_warnings or not is_calm:
            reasons = {} if is_calm else _reasons(cluster, moment)
            warnings = history.warnings[moment]
            if not problem and warnings.any():
                problem = warning_names(warnings)
        if problem and not reasons:
            reasons = dict.fromkeys(cluster.members, f"physics diverged: {problem}")
        found += [
            Casualty(birth, step, reason, population.find(birth).place)
            for birth, reason in reasons.items()
        ]
    return found


def _distinct(births: tuple[BirthId, ...]) -> tuple[BirthId, ...]:
    if len(set(births)) < len(births):
        raise UnexpectedEvent(f"apply: a robot is named twice in {births}")
    return births


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
