"""Checks that the sections of an experiment are consistent."""

from collections.abc import Callable
from math import isclose, lcm
from urllib.parse import quote

from schema.errors import ExperimentError
from schema.experiment.check_migration import migration_problem
from schema.experiment.document import (
    Arena,
    Culling,
    Experiment,
    Selection,
    body_space,
    island_experiment,
    steps_of,
)
from schema.experiment.environment import ground_problem

# File systems hold names of 255 bytes, of which the run's folders need some.
_LONGEST_NAME = 200


def check_experiment(experiment: Experiment, where: str) -> None:
    """Raise unless the sections of an experiment are consistent.

    Raises:
        ExperimentError: a name that no folder can have; limits that no robot can
            meet; a population too small to choose parents; a window that ends
            between two samples; an arena too small, or with intervals that are not
            multiples of its clocks; off-line keys in an arena; an extent that is
            not a whole number of patches; invalid scenery; an unknown plug-in; a
            migration that can never happen.
    """
    checks: list[Callable[[Experiment], str]] = [
        _limits_problem,
        _selection_problem,
        _culling_problem,
        _reevaluation_problem,
        _clock_problem,
        _duration_problem,
        _environment_problem,
        _arena_problem,
        _arena_clock_problem,
    ]
    first = 0
    for index, islands in enumerate(experiment.islands):
        alone = island_experiment(experiment, first)
        for check in checks:
            if problem := check(alone):
                raise ExperimentError(f"{where}: islands[{index}]: {problem}")
        first += islands.count
    if not experiment.islands:
        for check in checks:
            if problem := check(experiment):
                raise ExperimentError(f"{where}: {problem}")
    if problem := _name_problem(experiment.name) or migration_problem(experiment):
        raise ExperimentError(f"{where}: {problem}")
    types = body_space(experiment.space)
    core = next(kind for kind in types.values() if kind.is_root)
    if core.inputs > experiment.space.max_inputs:
        raise ExperimentError(
            f"{where}: space.max_inputs: must be >= {core.inputs}, the inputs of "
            f"{core.name}, got {experiment.space.max_inputs}"
        )
    if not any(kind.outputs for kind in types.values()):
        raise ExperimentError(
            f"{where}: space.part_types: at least one type must have a motor"
        )


def _name_problem(name: str) -> str:
    """Return what is wrong with a name: it becomes the name of a folder."""
    if not name.strip():
        return f"name: must not be empty, got {name!r}"
    if not name.isprintable():
        return f"name: must be printable, got {name!r}"
    length = len(quote(name, safe=""))
    if length > _LONGEST_NAME:
        return (
            f"name: must be <= {_LONGEST_NAME} bytes long after percent-encoding, "
            f"got {length}"
        )
    return ""


def _limits_problem(experiment: Experiment) -> str:
    space = experiment.space
    if space.min_parts > space.max_parts:
        return (
            f"space.min_parts: must be <= space.max_parts = {space.max_parts}, "
            f"got {space.min_parts}"
        )
    return "" if space.max_parts > 1 else "space.max_parts: must be > 1, got 1"


def _selection_problem(experiment: Experiment) -> str:
    selection = experiment.selection
    needed = selection.tournament_size + 1
    if selection.parents == "tournament" and selection.population < needed:
        return (
            f"selection.population: a tournament of {selection.tournament_size} for "
            f"two parents needs >= {needed}, got {selection.population}"
        )
    if selection.parents == "random" and selection.population < 2:  # noqa: PLR2004
        return "selection.population: two parents need >= 2, got 1"
    if not selection.keep_parents and selection.children < selection.population:
        return (
            "selection.children: must be >= selection.population = "
            f"{selection.population} if parents are not kept, "
            f"got {selection.children}"
        )
    if experiment.births < selection.population:
        return (
            f"births: must be >= selection.population = {selection.population}, "
            f"got {experiment.births}"
        )
    if experiment.window > selection.children:
        return (
            f"selection.window: must be <= selection.children = "
            f"{selection.children}, got {experiment.window}"
        )
    return ""


def _clock_problem(experiment: Experiment) -> str:
    clock = experiment.simulation
    if clock.window_steps % clock.pose_steps:
        return (
            "simulation.window_steps: must be a multiple of simulation.pose_steps = "
            f"{clock.pose_steps}, got {clock.window_steps}"
        )
    return ""


def _environment_problem(experiment: Experiment) -> str:
    environment = experiment.environment
    if problem := ground_problem(environment):
        return problem
    if not environment.scenery:
        return ""
    # MuJoCo is imported only if needed: it is slow to load.
    from schema.experiment.scenery import scenery_model  # noqa: PLC0415

    try:
        scenery_model(environment.scenery, experiment.simulation)
    except ExperimentError as error:
        return str(error)
    return ""


def _arena_problem(experiment: Experiment) -> str:
    arena, selection = experiment.arena, experiment.selection
    if arena is None:
        return ""
    if selection.survivors != "best" or not selection.keep_parents:
        return (
            "selection: survival in an arena depends on fitness; "
            'survivors must be "best" and keep_parents true'
        )
    if problem := _floor_problem(selection, arena):
        return f"arena.{problem}"
    lowest = max(arena.population_floor, selection.population)
    if arena.population_limit < lowest:
        return (
            "arena.population_limit: must be >= arena.population_floor and "
            f"selection.population, {lowest}, got {arena.population_limit}"
        )
    if arena.split_distance_m < arena.merge_distance_m:
        return (
            "arena.split_distance_m: must be >= arena.merge_distance_m = "
            f"{arena.merge_distance_m}, got {arena.split_distance_m}"
        )
    return ""


def _arena_clock_problem(experiment: Experiment) -> str:
    """Return which interval does not end on both a brain tick and a pose."""
    arena, clock = experiment.arena, experiment.simulation
    if arena is None:
        return ""
    for name in ("founder", "birth", "cull", "sample", "snapshot"):
        seconds: float = getattr(arena, f"{name}_interval_s")
        steps = steps_of(seconds, clock)
        tick = lcm(clock.brain_steps, clock.pose_steps)
        is_whole = isclose(steps * clock.timestep_s, seconds, rel_tol=1e-9)
        if not (steps and is_whole) or steps % tick:
            return (
                f"arena.{name}_interval_s: must be a whole multiple of "
                f"{tick * clock.timestep_s:g} s, the common multiple of "
                f"simulation.brain_steps and pose_steps, got {seconds:g}"
            )
    if clock.warmup_steps % clock.pose_steps:
        return (
            "simulation.warmup_steps: must be a multiple of simulation.pose_steps = "
            f"{clock.pose_steps}, got {clock.warmup_steps}"
        )
    return ""


def _culling_problem(experiment: Experiment) -> str:
    """Return what is wrong with ``selection.culling``, or nothing."""
    selection = experiment.selection
    rules = selection.culling
    if rules is None:
        return ""
    where = "selection.culling"
    if experiment.arena is not None:
        return f"{where}: arenas have these keys in [arena]; remove one of the two"
    if selection.survivors != "best" or not selection.keep_parents:
        return (
            f"{where}: survival depends on fitness; selection.survivors must be "
            '"best" and selection.keep_parents true'
        )
    problem = _floor_problem(selection, rules)
    lowest = max(rules.population_floor + 1, selection.population)
    if not problem and rules.population_limit < lowest:
        problem = (
            "population_limit: must be > population_floor and >= "
            f"selection.population, {lowest}, got {rules.population_limit}"
        )
    if problem:
        return f"{where}.{problem}"
    if round(rules.full_cull_share * rules.population_limit) < 1:
        return (
            f"{where}.full_cull_share: must remove at least one robot of "
            f"population_limit = {rules.population_limit}, "
            f"got {rules.full_cull_share:g}"
        )
    return ""


def _floor_problem(selection: Selection, rules: Arena | Culling) -> str:
    needed = selection.parents_needed
    if rules.population_floor < needed:
        return (
            f"population_floor: must be >= {needed}, so that there are always two "
            f"parents to choose, got {rules.population_floor}"
        )
    return ""


def _reevaluation_problem(experiment: Experiment) -> str:
    """Return what is wrong with ``selection.reevaluation``, or nothing."""
    selection = experiment.selection
    if selection.reevaluation is None:
        return ""
    where = "selection.reevaluation"
    if experiment.arena is not None:
        return f"{where}: arenas re-evaluate all the time; remove one of the two"
    if not selection.keep_parents:
        return (
            f"{where}: no individual outlives its brood if selection.keep_parents is "
            "false"
        )
    return ""


def _duration_problem(experiment: Experiment) -> str:
    """Return what is wrong with ``simulation.evaluation_s``, or nothing."""
    clock = experiment.simulation
    if clock.evaluation_s is None:
        return ""
    where = "simulation.evaluation_s"
    shortest, longest = clock.evaluation_s
    if experiment.arena is not None:
        return f"{where}: not for arenas, which evaluate all the time; remove it"
    least = (clock.warmup_steps + clock.window_steps) * clock.timestep_s
    if steps_of(shortest, clock) < clock.warmup_steps + clock.window_steps:
        return (
            f"{where}: must be >= {least:g} s, warmup_steps and window_steps "
            f"together, got {shortest:g}"
        )
    if longest < shortest:
        return f"{where}: must be [shortest, longest], got [{shortest:g}, {longest:g}]"
    return ""
