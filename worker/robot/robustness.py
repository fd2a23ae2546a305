"""Fitness of a robot under small changes of its simulation.

A robot that lives by a knife's edge of the physics, such as one contact more or less,
loses fitness when the simulation changes by less than any two machines of the real
world differ.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from msgspec.structs import replace

from schema.errors import FitnessUndefined, SensorFailed, SimulationDiverged
from schema.experiment.document import Simulation
from schema.experiment.robust import Robust
from schema.experiment.settings import EvaluationSettings
from schema.robot.results import Evaluation
from schema.robot.robot import Robot
from worker.robot.evaluation import evaluate

FINER = (2, 5)
"""Numbers of time steps that replace one."""
FRICTION = 0.99
"""Share of the friction that remains."""
LIFT_M = 1e-4
"""Mean height by which starts are raised [m]."""
STARTS = 8
_SEED = 1

FRICTIONS = (0.9, 0.99, 1.01, 1.1)
FACTORS = (0.9, 1.1)
"""Factors of masses and of torques."""
TILT_DEG = 1.0
NOISES = {"sensor_noise": 0.05, "actuator_noise": 0.01}
NOISY_TRIALS = 4
"""Evaluations with noise of their own whose mean counts."""
BUMP_M = 0.002
"""Height of the highest bump of ground that was a plane [m]."""
SLOPE_DEG = 1.0


@dataclass(frozen=True, slots=True)
class Change:
    """Changed settings, their name for people, and what is changed."""

    name: str
    settings: EvaluationSettings
    group: str = ""


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


def small_changes(settings: EvaluationSettings) -> tuple[Change, ...]:
    """Return settings with finer time steps, less friction, and raised starts.

    Args:
        settings: to change.

    Source: own definition.
    """
    world = settings.simulation
    changed = [
        *_finer_steps(world),
        _with_friction(world, FRICTION),
        *_raised_starts(world),
    ]
    return _as_changes(settings, changed)


def all_changes(settings: EvaluationSettings) -> tuple[Change, ...]:
    """Return settings with another time step, friction, start, noise, ground and robot.

    Time steps are finer. Friction, masses and torques differ by up to 10 %. Starts are
    raised or tilted. Sensors or motors have noise; the mean of several evaluations
    counts. A plane becomes rough or steeper; rough ground gets other bumps.

    Args:
        settings: to change, without ``robust``.

    Source: own definition.
    """
    world, ground = settings.simulation, settings.environment
    changed = [*_finer_steps(world)]
    changed += [_with_friction(world, factor) for factor in FRICTIONS]
    changed += _raised_starts(world)
    roll, pitch, yaw = world.start_deg
    for roll_deg, pitch_deg in ((1, 0), (-1, 0), (0, 1), (0, -1)):
        tilt = roll + TILT_DEG * roll_deg, pitch + TILT_DEG * pitch_deg, yaw
        axis, sign = ("x", roll_deg) if roll_deg else ("y", pitch_deg)
        name = f"start tilted {sign * TILT_DEG:+g} degree about {axis}"
        changed.append((name, "start", replace(world, start_deg=tilt)))
    for key in ("mass_factor", "torque_factor"):
        what = key.removesuffix("_factor")
        for factor in FACTORS:
            other = replace(world, **{key: factor * getattr(world, key)})
            changed.append((f"{what} x {factor:g}", what, other))
    found = list(_as_changes(settings, changed))
    for key, level in NOISES.items():
        noise = replace(_NO_DISTURBANCE, **{key: (level, level)})
        name = f"{key.replace('_', ' ')} {level:g}"
        found.append(Change(name, replace(settings, robust=noise), "noise"))
    steeper = replace(ground, slope_deg=ground.slope_deg + SLOPE_DEG)
    if ground.roughness_m:
        bumps = "other bumps", replace(ground, ground_seed=ground.ground_seed + 1)
    else:
        name = f"ground with bumps of {1000 * BUMP_M:g} mm"
        bumps = name, replace(ground, roughness_m=BUMP_M)
    for name, other_ground in (bumps, (f"slope {SLOPE_DEG:+g} degree", steeper)):
        other_settings = replace(settings, environment=other_ground)
        found.append(Change(name, other_settings, "ground"))
    return tuple(found)


_Changed = tuple[str, str, Simulation]
"""Name, group and simulation of a change."""

_NO_DISTURBANCE = Robust(
    draws=NOISY_TRIALS,
    friction=(1.0, 1.0),
    mass=(1.0, 1.0),
    torque=(1.0, 1.0),
    lift_m=(0.0, 0.0),
    tilt_deg=(0.0, 0.0),
    sensor_noise=(0.0, 0.0),
    actuator_noise=(0.0, 0.0),
)


def _finer_steps(world: Simulation) -> Iterator[_Changed]:
    for factor in FINER:
        fine = finer(world, factor)
        yield f"time step {fine.timestep_s:g} s", "time step", fine


def _with_friction(world: Simulation, factor: float) -> _Changed:
    friction = factor * world.friction
    changed = replace(world, friction=friction)
    return f"friction {friction:g}", "friction", changed


def _raised_starts(world: Simulation) -> Iterator[_Changed]:
    """Yield starts at heights that are drawn uniformly from 0 to ``2 LIFT_M``."""
    heights = np.random.default_rng(_SEED).uniform(0.0, 2 * LIFT_M, STARTS)
    for lift_m in heights.tolist():
        higher = replace(world, drop_m=world.drop_m + lift_m)
        yield f"start {1000 * lift_m:.4f} mm higher", "start", higher


def _as_changes(
    settings: EvaluationSettings, changed: Iterable[_Changed]
) -> tuple[Change, ...]:
    return tuple(
        Change(name, replace(settings, simulation=simulation), group)
        for name, group, simulation in changed
    )


def rejudge(
    robot: Robot,
    changes: Sequence[Change],
    evaluator: Callable[[Robot, EvaluationSettings], Evaluation] = evaluate,
) -> Iterator[Judged]:
    """Evaluate a robot under each change, in their order.

    Args:
        robot: a checked robot.
        changes: changed settings.
        evaluator: function that returns the evaluation of a robot.
    """
    for change in changes:
        try:
            fitness = evaluator(robot, change.settings).fitness
        except (SimulationDiverged, SensorFailed, FitnessUndefined):
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
