"""Fitness of a robot under small changes of its simulation.

A robot that lives by a knife's edge of the physics, such as one contact more or less,
loses fitness when the simulation changes by less than any two machines of the real
world differ.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np
from msgspec import Struct
from msgspec.structs import replace

from schema.errors import FAILURES
from schema.experiment.document import Simulation
from schema.experiment.robust import Robust
from schema.experiment.settings import (
    LATER_WINDOW,
    EvaluationSettings,
    later_windows,
)
from schema.robot.results import Evaluation, sustained
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


class ChangedSettings(Struct, frozen=True):
    """Settings with one change; ``is_small``: by less than two real machines differ."""

    name: str
    settings: EvaluationSettings
    group: str = ""
    is_small: bool = False


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


def window_changes(settings: EvaluationSettings) -> tuple[ChangedSettings, ...]:
    """Return settings of the windows after that of the evaluation, named by time."""
    changed = []
    for later in later_windows(settings):
        clock = later.simulation
        start, end = (
            steps * clock.timestep_s
            for steps in (clock.warmup_steps, clock.evaluation_steps)
        )
        name = f"window {start:g} to {end:g} s"
        changed.append(ChangedSettings(name, later, LATER_WINDOW))
    return tuple(changed)


def all_changes(settings: EvaluationSettings) -> tuple[ChangedSettings, ...]:
    """Return settings with another time step, friction, start, noise, ground and robot.

    The first ones have later windows. Time steps are finer. Friction, masses and
    torques differ by up to 10 %. Starts are raised or tilted. Sensors or motors have
    noise; the mean of several evaluations counts. A plane becomes rough or steeper;
    rough ground gets other bumps.

    The settings have no ``robust``.

    Source: own definition.
    """
    ground = settings.environment
    changed = [
        *window_changes(settings),
        *(
            ChangedSettings(name, replace(settings, simulation=world), group, is_small)
            for name, group, world, is_small in _simulations(settings.simulation)
        ),
    ]
    for key, level in NOISES.items():
        noise = replace(_NO_DISTURBANCE, **{key: (level, level)})
        name = f"{key.replace('_', ' ')} {level:g}"
        changed.append(ChangedSettings(name, replace(settings, robust=noise), "noise"))
    steeper = replace(ground, slope_deg=ground.slope_deg + SLOPE_DEG)
    if ground.roughness_m:
        bumps = "other bumps", replace(ground, ground_seed=ground.ground_seed + 1)
    else:
        name = f"ground with bumps of {1000 * BUMP_M:g} mm"
        bumps = name, replace(ground, roughness_m=BUMP_M)
    for name, other in (bumps, (f"slope {SLOPE_DEG:+g} degree", steeper)):
        elsewhere = replace(settings, environment=other)
        changed.append(ChangedSettings(name, elsewhere, "ground"))
    return tuple(changed)


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


def _simulations(world: Simulation) -> Iterator[tuple[str, str, Simulation, bool]]:
    """Yield name, group, simulation and smallness of each change of the simulation."""
    for factor in FINER:
        fine = finer(world, factor)
        yield f"time step {fine.timestep_s:g} s", "time step", fine, True
    for share in FRICTIONS:
        friction = share * world.friction
        slippery = replace(world, friction=friction)
        yield f"friction {friction:g}", "friction", slippery, share == FRICTION
    # Drawn uniformly from 0 to twice the mean.
    heights = np.random.default_rng(_SEED).uniform(0.0, 2 * LIFT_M, STARTS)
    for lift_m in heights.tolist():
        higher = replace(world, drop_m=world.drop_m + lift_m)
        yield f"start {1000 * lift_m:.4f} mm higher", "start", higher, True
    for number, axis in enumerate("xy"):
        for tilt_deg in (TILT_DEG, -TILT_DEG):
            start = [*world.start_deg]
            start[number] += tilt_deg
            tilted = replace(world, start_deg=tuple(start))
            yield (
                f"start tilted {tilt_deg:+g} degree about {axis}",
                "start",
                tilted,
                False,
            )
    for key in ("mass_factor", "torque_factor"):
        what = key.removesuffix("_factor")
        for share in FACTORS:
            other = replace(world, **{key: share * getattr(world, key)})
            yield f"{what} x {share:g}", what, other, False


def rejudge(
    robot: Robot,
    changes: Iterable[ChangedSettings],
    evaluator: Callable[[Robot, EvaluationSettings], Evaluation] = evaluate,
) -> Iterator[tuple[ChangedSettings, float | None]]:
    """Yield each change and the fitness under it; None if the evaluation failed."""
    for change in changes:
        try:
            yield change, evaluator(robot, change.settings).fitness
        except FAILURES:
            yield change, None


def summary(
    fitness: float, found: Sequence[float | None], later: Sequence[float | None]
) -> str:
    """Return one line that says how much of its fitness a robot keeps.

    ``found`` under small changes, ``later`` in the later windows.
    """
    share = sustained(fitness, later)
    line = _kept_line(fitness, found)
    if share is None:
        return line
    return f"{line}; sustains {100 * share:.0f} % in the next {len(later)} windows"


def _kept_line(fitness: float, found: Sequence[float | None]) -> str:
    known = [each for each in found if each is not None]
    under = f"under {len(found)} small changes of time step, friction and start"
    if not known:
        return f"has no fitness {under}, {fitness:.3g} without"
    failed = len(found) - len(known)
    least, most = min(known), max(known)
    if fitness > 0:
        shares = f"{100 * least / fitness:.0f} to {100 * most / fitness:.0f} %"
        line = f"keeps {shares} of its fitness ({fitness:.3g}) {under}"
    else:
        line = (
            f"has a fitness of {least:.3g} to {most:.3g} {under}, {fitness:.3g} without"
        )
    return f"{line}; {failed} of them failed" if failed else line
