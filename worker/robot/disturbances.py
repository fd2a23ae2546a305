"""Disturbed simulations of one evaluation, and what their results come to.

Draws depend on the identity of the evaluation alone, so that births do not depend on
workers.
"""

import math
from collections.abc import Iterator, Sequence

import numpy as np
from msgspec.structs import replace

from schema.experiment.document import Simulation
from schema.experiment.identity import Identity
from schema.experiment.robust import RANGES, Robust
from schema.experiment.settings import EvaluationSettings
from schema.robot.results import Evaluation
from worker.filters.noise import DrawPurpose, stream


def disturbances(
    settings: EvaluationSettings, rules: Robust, identity: Identity
) -> Iterator[tuple[EvaluationSettings, Identity]]:
    """Yield the settings of each simulation of an evaluation, and its identity.

    The identities differ in the trial, so that each simulation has its own noise.
    """
    for number in range(rules.draws):
        rng = stream(
            DrawPurpose.DISTURBANCES,
            identity.origin,
            identity.birth,
            identity.trial,
            number,
        )
        simulation = disturbed(settings.simulation, rules, rng)
        trial = identity.trial * rules.draws + number
        yield (
            replace(settings, simulation=simulation, robust=None),
            Identity(identity.origin, identity.birth, trial),
        )


def disturbed(world: Simulation, rules: Robust, rng: np.random.Generator) -> Simulation:
    """Return a simulation with numbers drawn from the ranges of the rules.

    All numbers are drawn, also from ranges of width 0: one range does not change the
    draws from another.
    """
    drawn = {name: _draw(rules, name, rng) for name in RANGES}
    pitch = _draw(rules, "tilt_deg", rng)
    roll_deg, pitch_deg, yaw_deg = world.start_deg
    return replace(
        world,
        friction=world.friction * drawn["friction"],
        mass_factor=world.mass_factor * drawn["mass"],
        torque_factor=world.torque_factor * drawn["torque"],
        drop_m=world.drop_m + drawn["lift_m"],
        start_deg=(
            roll_deg + drawn["tilt_deg"],
            pitch_deg + pitch,
            yaw_deg + drawn["heading_deg"],
        ),
        sensor_noise=world.sensor_noise + drawn["sensor_noise"],
        actuator_noise=world.actuator_noise + drawn["actuator_noise"],
    )


def _draw(rules: Robust, name: str, rng: np.random.Generator) -> float:
    low, high = getattr(rules, name)
    if rules.distribution == "uniform":
        return float(low + (high - low) * rng.random())
    wide = 0.5 * (low + high) + 0.25 * (high - low) * rng.standard_normal()
    return float(min(max(wide, low), high))


def combined(found: Sequence[Evaluation], rules: Robust) -> Evaluation:
    """Return one evaluation of several simulations.

    Its fitness follows the rules, its length is that of one simulation, and all else
    are means.
    """
    return Evaluation(
        _taken([each.fitness for each in found], rules),
        _mean([each.path_velocity for each in found]),
        _mean([each.straight_velocity for each in found]),
        found[0].simulated_s,
        tuple(map(_mean, zip(*(each.measures for each in found), strict=True))),
    )


def _taken(fitness: Sequence[float], rules: Robust) -> float:
    if rules.take == "least":
        return min(fitness)
    if rules.take == "mean":
        return _mean(fitness)
    return float(np.quantile(fitness, rules.quantile))


def _mean(values: Sequence[float]) -> float:
    return math.fsum(values) / len(values)
