"""What goes with a request, beside the robot: the part of an experiment it needs."""

from collections.abc import Callable
from functools import lru_cache
from typing import TypeVar, cast

import msgspec

from schema.errors import ExperimentError
from schema.experiment.document import (
    Arena,
    Experiment,
    Fitness,
    Simulation,
    Space,
    Vetting,
)
from schema.experiment.environment import FLAT, Environment
from schema.experiment.identity import Origin
from schema.experiment.plugin import load
from schema.experiment.section import Section

T = TypeVar("T")


class VettingSettings(Section, frozen=True):
    """What an analyzer's answer depends on, beside the robot."""

    space: Space
    vetting: Vetting


class EvaluationSettings(Section, frozen=True):
    """What a worker's answer depends on, beside the robot."""

    space: Space
    simulation: Simulation
    fitness: Fitness
    environment: Environment = FLAT


class ArenaSettings(Section, frozen=True):
    """What an arena's advances depend on, beside its state and its changes."""

    space: Space
    simulation: Simulation
    fitness: Fitness
    arena: Arena
    environment: Environment = FLAT
    origin: Origin = Origin()


def vetting_settings(experiment: Experiment) -> bytes:
    """Return the JSON that goes with every vetting request."""
    return msgspec.json.encode(
        VettingSettings(space=experiment.space, vetting=experiment.vetting)
    )


def evaluation_settings(experiment: Experiment) -> bytes:
    """Return the JSON that goes with every evaluation request."""
    return msgspec.json.encode(
        EvaluationSettings(
            space=experiment.space,
            simulation=experiment.simulation,
            fitness=experiment.fitness,
            environment=experiment.environment,
        )
    )


def arena_settings(experiment: Experiment, origin: Origin) -> bytes:
    """Return the JSON that goes with every request about the experiment's arena.

    Args:
        experiment: the island's.
        origin: the run and the island.

    Raises:
        ExperimentError: an off-line experiment.
    """
    if experiment.arena is None:
        raise ExperimentError(f"{experiment.name}: has no arena")
    return msgspec.json.encode(
        ArenaSettings(
            origin=origin,
            space=experiment.space,
            simulation=experiment.simulation,
            fitness=experiment.fitness,
            environment=experiment.environment,
            arena=experiment.arena,
        )
    )


@lru_cache(maxsize=64)
def read_arena_settings(settings: bytes) -> ArenaSettings:
    """Return the settings of a request to advance an arena.

    Raises:
        ExperimentError: not such settings.
    """
    return _from_json(settings, ArenaSettings)


@lru_cache(maxsize=64)
def read_vetting_settings(settings: bytes) -> VettingSettings:
    """Return the settings of a vetting request.

    Raises:
        ExperimentError: not such settings.
    """
    return _from_json(settings, VettingSettings)


@lru_cache(maxsize=64)
def read_evaluation_settings(settings: bytes) -> EvaluationSettings:
    """Return the settings of an evaluation request.

    Raises:
        ExperimentError: not such settings.
    """
    return _from_json(settings, EvaluationSettings)


def _from_json(settings: bytes, kind: type[T]) -> T:
    try:
        return msgspec.json.decode(settings, type=kind)
    except msgspec.MsgspecError as error:
        raise ExperimentError(f"settings of a request: {error}") from None


def lasting(settings: EvaluationSettings, steps: int) -> EvaluationSettings:
    """Return settings by which an evaluation takes so many physics steps.

    What is more than the window comes before it. With 0 steps nothing changes.

    Raises:
        ExperimentError: not even the window lasts so short.
    """
    if not steps:
        return settings
    clock = settings.simulation
    if steps < clock.window_steps:
        raise ExperimentError(
            f"an evaluation must take >= simulation.window_steps = "
            f"{clock.window_steps} steps, got {steps}"
        )
    warmup = steps - clock.window_steps
    simulation = msgspec.structs.replace(clock, warmup_steps=warmup)
    return msgspec.structs.replace(settings, simulation=simulation)


@lru_cache(maxsize=64)
def fitness_function(fitness: Fitness) -> Callable[..., float]:
    """Return the function that a document names.

    Raises:
        UnknownPlugin: a name that nothing answers to.
        ExperimentError: not a function.
    """
    function = load(fitness.function, "fitness.function")
    if not callable(function):
        raise ExperimentError(f"fitness.function: {fitness.function!r} is no function")
    return cast("Callable[..., float]", function)
