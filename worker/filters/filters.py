"""Filters between the sensors, brains and motors of robots: noise, faults, pushes."""

from collections.abc import Iterable, Sequence
from typing import Protocol

import mujoco

from schema.experiment.brains import widths
from schema.experiment.document import body_space
from schema.experiment.identity import Identity
from schema.experiment.settings import EvaluationSettings
from schema.robot.robot import Robot
from schema.robot.trace import Floats
from worker.filters.channels import Ablated, Calibrated
from worker.filters.noise import Noise, Pushes


class Filter(Protocol):
    """Change of what R brains receive, and of what reaches the motors, at a tick.

    Arrays that a filter gets stay as they are.
    """

    def readings(self, tick: int, values: Floats) -> Floats:
        """Return the readings (R, N) after the filter."""

    def outputs(self, tick: int, values: Floats) -> Floats:
        """Return the outputs of the brains (R, O), unclipped, after the filter."""


def filtered_readings(filters: Iterable[Filter], tick: int, values: Floats) -> Floats:
    """Return readings (R, N) after all filters, in their order."""
    for stage in filters:
        values = stage.readings(tick, values)
    return values


def filtered_outputs(filters: Iterable[Filter], tick: int, values: Floats) -> Floats:
    """Return outputs (R, O) after all filters, in their order."""
    for stage in filters:
        values = stage.outputs(tick, values)
    return values


def filters_of(
    robot: Robot,
    settings: EvaluationSettings,
    identity: Identity,
    state: tuple[mujoco.MjModel, mujoco.MjData],
    means: Sequence[float] = (),
) -> tuple[Filter, ...]:
    """Return the filters of an evaluation, in the order in which they act.

    Noise and pushes depend on the identity; ``means`` are those of ``mean_inputs``.

    Raises:
        InvalidRobot: an ablation of another robot.
    """
    clock, environment = settings.simulation, settings.environment
    width, filters = widths(settings.space), list[Filter]()
    further: tuple[Floats, Floats] | None = None
    if settings.calibration:
        calibrated = Calibrated(
            robot,
            body_space(settings.space),
            settings.calibration,
            tick_s=clock.tick_s,
            width=width,
        )
        filters.append(calibrated)
        further = calibrated.noise
    if clock.sensor_noise or clock.actuator_noise or further:
        births = (identity.birth,)
        filters.append(
            Noise(
                clock, width, identity.origin, births, identity.trial, further=further
            )
        )
    if settings.ablation is not None:
        filters.append(Ablated(settings.ablation, robot, means))
    if environment.push_impulse:
        filters.append(Pushes(environment, clock, identity, *state))
    return tuple(filters)
