"""Measures of a trace beside its fitness: built-in ones, and those of experiments.

The built-in ones are finite for every trace of a living robot. T is the number of
samples, P that of the parts, J that of the joints.
"""

import math
from functools import lru_cache
from typing import Any

import numpy as np

from schema.errors import ExperimentError
from schema.experiment.document import Measures
from schema.experiment.settings import ArenaSettings, EvaluationSettings
from schema.plugins.load import load_function, load_object
from schema.plugins.parameters import parameters_type, read_parameters
from schema.plugins.protocols import MeasureFunction
from schema.robot.trace import Trace, channels_of, needs
from worker import descriptors
from worker.fitness import (
    Functions,
    TraceFunction,
    load_fitness,
    path_velocity,
    straight_velocity,
)

LEAST_DISTANCE_M = 0.001
"""Distance of a robot that stands still, in the cost of transport [m]."""
MIRROR_TOLERANCE_M = 0.01
"""Greatest distance between a part and the mirror image of its counterpart [m]."""


@needs("core_attitude")
def turning(trace: Trace) -> float:
    """Return the mean absolute rate of turning about the vertical axis [rad/s].

    The sum of abs(change of heading) between samples, over the duration. The heading
    is the direction of the core's x axis in the ground plane; each change is taken as
    the shorter way round, so a robot that turns by more than half a turn between two
    samples is measured as slower.

    Source: own definition.
    """
    w, x, y, z = trace.core_attitude.T
    heading = np.arctan2(2.0 * (x * y + w * z), 1.0 - 2.0 * (y * y + z * z))
    change = np.diff(heading)
    shorter = (change + np.pi) % (2.0 * np.pi) - np.pi
    return float(np.abs(shorter).sum()) / trace.duration_s


@needs("energy")
def energy(trace: Trace) -> float:
    """Return the absolute mechanical work of all motors over the window [J].

    Source: own definition, see ``Trace.energy``.
    """
    return float(trace.energy[-1])


@needs("energy")
def cost_of_transport(trace: Trace) -> float:
    """Return energy over weight and distance, E / (m g d) [1].

    E is the measure ``energy``, m the mass, g gravity, and d the distance between the
    ends of the path in the ground plane, at least ``LEAST_DISTANCE_M``.

    Raises:
        ValueError: there is no gravity, so no weight.

    Source: Gabrielli and von Karman 1950, "What price speed?"; mechanical work in
    place of the power of an engine.
    """
    if trace.gravity == 0.0:
        raise ValueError("the cost of transport needs simulation.gravity > 0")
    x, y = (trace.core_position[-1, :2] - trace.core_position[0, :2]).tolist()
    distance = max(math.hypot(x, y), LEAST_DISTANCE_M)
    return float(trace.energy[-1]) / (trace.mass * trace.gravity * distance)


def height(trace: Trace) -> float:
    """Return the mean height of the core's centre over the window, world frame [m].

    Source: own definition.
    """
    return float(trace.core_position[:, 2].mean())


@needs("part_position")
def body_symmetry(trace: Trace) -> float:
    """Return the share of parts with a mirror image, in the better of two planes [1].

    The planes are those through the core's centre, along its x and z axes, and along
    its y and z axes. A part has a mirror image if a part of the same kind is within
    ``MIRROR_TOLERANCE_M`` of its mirrored position, joints at 0; a part on the plane
    is its own. Orientations of parts do not count. The least value is 1 / P, of the
    core alone; 1 is a symmetrical body.

    Source: own definition, after the reflective symmetry of Miras et al. 2018,
    "Search space analysis of evolvable robot morphologies".
    """
    places = trace.part_position
    kinds = np.array([part.kind for part in trace.robot.parts])
    is_same = kinds[:, np.newaxis] == kinds
    shares = []
    for flip in ((1.0, -1.0, 1.0), (-1.0, 1.0, 1.0)):
        apart = (places * flip)[:, np.newaxis] - places
        is_near = np.sqrt((apart * apart).sum(axis=2)) <= MIRROR_TOLERANCE_M
        shares.append(float((is_near & is_same).any(axis=1).mean()))
    return max(shares)


@needs("joint_torque")
def joint_effort(trace: Trace) -> float:
    """Return the mean absolute torque of the joints over the window [N m].

    The mean over samples and joints of abs(torque); joints without a motor count as 0,
    and sliding joints with their force [N]. A robot without joints has 0.

    Source: own definition.
    """
    torque = trace.joint_torque
    return float(np.abs(torque).mean()) if torque.size else 0.0


@needs("contact")
def contact_share(trace: Trace) -> float:
    """Return the mean share of parts in contact with anything but the robot [1].

    The mean over samples and parts of ``Trace.contact``: 0 in the air, 1 if all parts
    always touch the ground, scenery or other robots.

    Source: own definition.
    """
    return float(trace.contact.mean())


BUILT_IN: dict[str, MeasureFunction] = {
    function.__name__: function
    for function in (
        path_velocity,
        straight_velocity,
        turning,
        energy,
        cost_of_transport,
        height,
        body_symmetry,
        joint_effort,
        contact_share,
        descriptors.body_size,
        descriptors.body_proportion,
        descriptors.body_limbs,
        descriptors.body_coverage,
        descriptors.body_joints,
        descriptors.duty_factor,
        descriptors.periodicity,
    )
}
"""Measures by short name."""


@lru_cache(maxsize=64)
def measures_of(measures: Measures) -> tuple[TraceFunction, ...]:
    """Return the measures that an experiment names, in its order.

    Raises:
        UnknownPlugin: no such measure, or a module that is not allowed.
        ExperimentError: not a function, or parameters that it refuses.
    """
    labels = zip(measures.names, measures.labels, strict=True)
    return tuple(
        _measure(name, measures.parameters.get(label), f"measures.parameters.{label}")
        for name, label in labels
    )


def _measure(name: str, table: dict[str, Any] | None, where: str) -> TraceFunction:
    where_named = "measures.names"
    found = load_object(name, where_named, BUILT_IN)
    if not callable(found):
        raise ExperimentError(f"{where_named}: {name!r} is not a function")
    kind = parameters_type(found, where_named)
    if ":" in name:
        names = "trace" if kind is None else "trace, parameters"
        load_function(name, where_named, 1 if kind is None else 2, names)
    if kind is None:
        if table is not None:
            then = "it must annotate its second argument with a msgspec Struct"
            if name in BUILT_IN:
                then = "remove the table"
            raise ExperimentError(
                f"{where}: {name} has no parameters of its own; {then}"
            )
        return TraceFunction(f"measure {name}", found)
    parameters = read_parameters(table or {}, kind, where)
    return TraceFunction(f"measure {name}", found, (parameters,))


@lru_cache(maxsize=64)
def functions_of(settings: EvaluationSettings | ArenaSettings) -> Functions:
    """Return the functions that the settings of a request name.

    Raises:
        ExperimentError: an unknown function, or parameters that it refuses.
    """
    fitness, measures = load_fitness(settings.fitness), measures_of(settings.measures)
    functions = [fitness.function, *(each.function for each in measures)]
    record = settings.record if isinstance(settings, EvaluationSettings) else ()
    return Functions(fitness, measures, channels_of(functions, record))
