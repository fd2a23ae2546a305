"""Fitness of a robot under small changes of its simulation.

A robot that lives by a knife's edge of the physics, such as one contact more or less,
loses fitness when the simulation changes by less than any two machines of the real
world differ.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from msgspec.structs import replace

from schema.errors import FitnessUndefined, SimulationDiverged
from schema.experiment.document import Simulation
from schema.experiment.identity import NO_IDENTITY, Identity
from schema.experiment.settings import EvaluationSettings
from schema.robot.robot import Robot
from worker.robot.evaluation import evaluate

FINER = (2, 5)
"""Numbers of time steps that replace one."""
FRICTION = 0.99
"""Share of the friction that remains."""
LIFT_M = 1e-4
"""Mean height by which starts are raised [m]."""
STARTS = 8


@dataclass(frozen=True, slots=True)
class Change:
    """Changed settings, and their name for people."""

    name: str
    settings: EvaluationSettings


@dataclass(frozen=True, slots=True)
class Judged:
    """Fitness of a robot under a change; None if the evaluation failed."""

    change: Change
    fitness: float | None


def finer(simulation: Simulation, factor: int = 5) -> Simulation:
    """Return the simulation with a time step that many times finer."""
    return replace(
        simulation,
        timestep_s=simulation.timestep_s / factor,
        brain_steps=simulation.brain_steps * factor,
        pose_steps=simulation.pose_steps * factor,
        window_steps=simulation.window_steps * factor,
        warmup_steps=simulation.warmup_steps * factor,
    )


def small_changes(settings: EvaluationSettings, seed: int = 1) -> tuple[Change, ...]:
    """Return settings with finer time steps, less friction, and raised starts.

    Args:
        settings: to change.
        seed: of the heights, drawn uniformly from 0 to ``2 LIFT_M``.

    Source: own definition.
    """
    world = settings.simulation
    changed = [
        (f"time step {fine.timestep_s:g} s", fine)
        for fine in (finer(world, factor) for factor in FINER)
    ]
    friction = FRICTION * world.friction
    changed.append((f"friction {friction:g}", replace(world, friction=friction)))
    for lift_m in np.random.default_rng(seed).uniform(0.0, 2 * LIFT_M, STARTS).tolist():
        higher = replace(world, drop_m=world.drop_m + lift_m)
        changed.append((f"start {1000 * lift_m:.3f} mm higher", higher))
    return tuple(
        Change(name, replace(settings, simulation=simulation))
        for name, simulation in changed
    )


def rejudge(
    robot: Robot, changes: Sequence[Change], identity: Identity = NO_IDENTITY
) -> Iterator[Judged]:
    """Evaluate a robot under each change, in their order.

    Args:
        robot: a checked robot.
        changes: changed settings.
        identity: of the evaluations; noise and pushes depend on it.
    """
    for change in changes:
        try:
            fitness = evaluate(robot, change.settings, identity).fitness
        except (SimulationDiverged, FitnessUndefined):
            yield Judged(change, None)
        else:
            yield Judged(change, fitness)


def summary(fitness: float, judged: Sequence[Judged]) -> str:
    """Return one line that says how much of its fitness a robot keeps.

    Args:
        fitness: without changes.
        judged: under changes; at least one.
    """
    known = [one.fitness for one in judged if one.fitness is not None]
    under = f"under {len(judged)} small changes of time step, friction and start"
    if not known:
        return f"has no fitness {under}, {fitness:.3g} without"
    failed = len(judged) - len(known)
    least, most = min(known), max(known)
    if fitness > 0:
        shares = f"{100 * least / fitness:.0f} to {100 * most / fitness:.0f} %"
        line = f"keeps {shares} of its fitness ({fitness:.3g}) {under}"
    else:
        line = (
            f"has a fitness of {least:.3g} to {most:.3g} {under}, {fitness:.3g} without"
        )
    return f"{line}; {failed} of them failed" if failed else line
