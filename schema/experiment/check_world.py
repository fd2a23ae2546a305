"""Checks of the world of an experiment: ground, scenery, light and pushes."""

from collections.abc import Iterator
from math import isclose

from schema.errors import ExperimentError, shown
from schema.experiment.document import Experiment, light_of, start_problems, steps_of
from schema.experiment.environment import arena_problems, ground_problems
from schema.experiment.settings import FITNESS


def world_problems(experiment: Experiment) -> Iterator[str]:
    """Yield what is wrong with the world of one island."""
    yield from ground_problems(experiment.environment)
    if experiment.arena is not None:
        yield from arena_problems(experiment.environment)
        yield from start_problems(experiment.simulation)
    yield from _scenery_problems(experiment)
    yield from _push_problems(experiment)
    yield from _light_problems(experiment)


def _scenery_problems(experiment: Experiment) -> Iterator[str]:
    if scenery := experiment.environment.scenery:
        # MuJoCo is imported only if needed: it is slow to load.
        from schema.experiment.scenery import (  # noqa: PLC0415
            refuse_objects,
            scenery_model,
        )

        try:
            scenery_model(scenery, experiment.simulation)
            if experiment.arena is not None:
                refuse_objects(experiment.environment, experiment.simulation)
        except ExperimentError as error:
            yield str(error)


def _push_problems(experiment: Experiment) -> Iterator[str]:
    """Yield whether pushes do not begin at a tick, or never begin."""
    world, clock = experiment.environment, experiment.simulation
    tick_s = clock.tick_s
    ticks = max(1, round(world.push_interval_s / tick_s))
    is_whole = isclose(ticks * tick_s, world.push_interval_s, rel_tol=1e-9)
    if world.push_impulse and not is_whole:
        yield (
            f"environment.push_interval_s: must be a whole multiple of {tick_s:g} s, "
            f"the time between brain ticks, got {world.push_interval_s:g}"
        )
    steps = clock.evaluation_steps
    if clock.evaluation_s is not None:
        steps = steps_of(clock.evaluation_s[1], clock)
    is_never = experiment.arena is None and ticks * clock.brain_steps >= steps
    if world.push_impulse and is_never:
        yield (
            f"environment.push_interval_s: must be < {steps * clock.timestep_s:g} s, "
            "the longest evaluation, or there is no push, got "
            f"{world.push_interval_s:g}"
        )


def _light_problems(experiment: Experiment) -> Iterator[str]:
    arena, there = experiment.arena, experiment.environment.light
    function = experiment.fitness.function
    needs_light = function in ("light", FITNESS["light"])
    if needs_light and not light_of(experiment.environment, arena):
        yield (
            f"fitness.function: {shown(function)} needs environment.light = [x, y, z], "
            "got none"
        )
    here = None if arena is None else arena.light
    if here and there and here != there:
        yield (
            f"arena.light: differs from environment.light = {list(there)}, got "
            f"{list(here)}; remove one of the two"
        )
