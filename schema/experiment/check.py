"""Checks that the sections of an experiment are consistent."""

from collections.abc import Iterator
from contextlib import contextmanager
from math import isclose, lcm
from urllib.parse import quote

from schema.errors import ExperimentError, nearest, shown
from schema.experiment.brains import neuron_kinds
from schema.experiment.check_migration import migration_problems
from schema.experiment.check_world import world_problems
from schema.experiment.document import (
    ArenaSection,
    Culling,
    Experiment,
    Measures,
    SelectionSection,
    Simulation,
    body_space,
    island_experiment,
    light_of,
    pose_problems,
    steps_of,
)
from schema.experiment.learning import learning_problems
from schema.experiment.robust import (
    calibration_problems,
    delay_problems,
    robust_problems,
)
from schema.experiment.selection_rules import rule_problems
from schema.parts import BodySpace, Sensor

# File systems hold names of 255 bytes, of which the run's folders need some.
_LONGEST_NAME = 200


def check_experiment(experiment: Experiment, where: str) -> None:
    """Raise unless the sections of an experiment are consistent.

    Raises:
        ExperimentError: the first thing that is wrong; the message names file and
            key.
    """
    with naming(where):
        if problem := next(_problems(experiment), ""):
            raise ExperimentError(problem)


@contextmanager
def naming(where: str) -> Iterator[None]:
    """Add the file of an experiment to the message of an error."""
    try:
        yield
    except ExperimentError as error:
        raise type(error)(f"{where}: {error}") from error


def _problems(experiment: Experiment) -> Iterator[str]:
    """Yield what is wrong with an experiment; each check relies on those before it."""
    for where, own in _each_island(experiment):
        for problem in _island_problems(own):
            yield f"{where}{problem}"
    yield from _name_problems(experiment.name)
    yield from migration_problems(experiment)
    yield from _measures_problems(experiment.measures)
    types = body_space(experiment.space)
    core = next(kind for kind in types.values() if kind.is_root)
    if core.inputs > experiment.space.max_inputs:
        yield (
            f"space.max_inputs: must be >= {core.inputs}, the inputs of "
            f"{core.name}, got {experiment.space.max_inputs}"
        )
    if not any(kind.outputs for kind in types.values()):
        yield "space.part_types: at least one type must have a motor"
    yield from _light_sensor_problems(experiment, types)
    yield from calibration_problems(experiment.calibration, types)
    # Loads and checks both; raises what is wrong.
    neuron_kinds(experiment.brain, experiment.space)


def _light_sensor_problems(experiment: Experiment, types: BodySpace) -> Iterator[str]:
    """Yield the islands on which robots may have light sensors, but no light is."""
    sensing = [
        name
        for name, kind in types.items()
        if any(isinstance(s, Sensor) and s.kind == "light" for s in kind.sensors)
    ]
    if not sensing:
        return
    problem = (
        f"space.part_types: the light sensor of {shown(sensing[0])} needs "
        "environment.light = [x, y, z], got none"
    )
    for where, own in _each_island(experiment):
        if not light_of(own.environment, own.arena):
            yield f"{where}{problem}"


def _each_island(experiment: Experiment) -> Iterator[tuple[str, Experiment]]:
    """Yield where the settings of equal islands stand, and these settings."""
    if not experiment.islands:
        yield "", experiment
    first = 0
    for index, islands in enumerate(experiment.islands):
        yield f"islands[{index}]: ", island_experiment(experiment, first)
        first += islands.count


def _island_problems(experiment: Experiment) -> Iterator[str]:
    """Yield what is wrong with the sections of one island."""
    yield from _limits_problems(experiment)
    yield from _selection_problems(experiment)
    yield from _culling_problems(experiment)
    yield from _reevaluation_problems(experiment)
    yield from pose_problems(experiment.simulation, "window_steps")
    yield from _duration_problems(experiment)
    yield from world_problems(experiment)
    is_arena, clock = experiment.arena is not None, experiment.simulation
    yield from robust_problems(experiment.robust, is_arena=is_arena)
    yield from learning_problems(
        experiment.learning,
        is_reevaluated=experiment.selection.reevaluation is not None,
        encoding=experiment.encoding.type,
    )
    yield from delay_problems(experiment.calibration, clock.tick_s, is_arena=is_arena)
    if experiment.arena is not None:
        yield from _arena_problems(experiment, experiment.arena)
        yield from _arena_clock_problems(experiment.arena, experiment.simulation)
        if experiment.learning is not None:
            yield from _infancy_problems(experiment.simulation)


def _measures_problems(measures: Measures) -> Iterator[str]:
    """Yield what is wrong with ``measures``; names are looked up elsewhere."""
    labels = measures.labels
    for label in labels:
        if labels.count(label) > 1:
            yield f"measures.names: two measures are named {shown(label)}"
    for label in measures.parameters:
        if label not in labels:
            yield (
                f"measures.parameters.{shown(label)}: is not in measures.names"
                f"{nearest(label, labels)}"
            )


def _name_problems(name: str) -> Iterator[str]:
    """Yield what is wrong with a name: it becomes the name of a folder."""
    if not name.strip():
        yield f"name: must not be empty, got {name!r}"
    if not name.isprintable():
        yield f"name: must be printable, got {name!r}"
    length = len(quote(name, safe=""))
    if length > _LONGEST_NAME:
        yield (
            f"name: must be <= {_LONGEST_NAME} bytes long after percent-encoding, "
            f"got {length}"
        )


def _limits_problems(experiment: Experiment) -> Iterator[str]:
    space = experiment.space
    if space.min_parts > space.max_parts:
        yield (
            f"space.min_parts: must be <= space.max_parts = {space.max_parts}, "
            f"got {space.min_parts}"
        )
    if space.max_parts == 1:
        yield "space.max_parts: must be > 1, got 1"


def _selection_problems(experiment: Experiment) -> Iterator[str]:
    selection = experiment.selection
    needed = selection.tournament_size + 1
    if selection.parents == "tournament" and selection.population < needed:
        yield (
            f"selection.population: a tournament of {selection.tournament_size} for "
            f"two parents needs >= {needed}, got {selection.population}"
        )
    yield from rule_problems(selection)
    if selection.parents not in ("tournament", "none") and selection.population < 2:  # noqa: PLR2004
        yield "selection.population: two parents need >= 2, got 1"
    if not selection.keep_parents and selection.children < selection.population:
        yield (
            "selection.children: must be >= selection.population = "
            f"{selection.population} if parents are not kept, "
            f"got {selection.children}"
        )
    if experiment.births < selection.population:
        yield (
            f"births: must be >= selection.population = {selection.population}, "
            f"got {experiment.births}"
        )
    if experiment.window > selection.children:
        yield (
            f"selection.window: must be <= selection.children = "
            f"{selection.children}, got {experiment.window}"
        )


def _arena_problems(experiment: Experiment, arena: ArenaSection) -> Iterator[str]:
    selection = experiment.selection
    if selection.survivors != "best" or not selection.keep_parents:
        yield (
            "selection: survival in an arena depends on fitness; "
            'survivors must be "best" and keep_parents true'
        )
    yield from _floor_problems("arena", selection, arena)
    lowest = max(arena.population_floor, selection.population)
    if arena.population_limit < lowest:
        yield (
            "arena.population_limit: must be >= arena.population_floor and "
            f"selection.population, {lowest}, got {arena.population_limit}"
        )
    if arena.split_distance_m < arena.merge_distance_m:
        yield (
            "arena.split_distance_m: must be >= arena.merge_distance_m = "
            f"{arena.merge_distance_m}, got {arena.split_distance_m}"
        )
    radius_m = 0.5 * arena.wall_diameter_m
    if 0.0 < radius_m <= arena.birth_radius_m:
        yield (
            f"arena.birth_radius_m: must be less than half of wall_diameter_m, "
            f"{radius_m:g} m, as robots are born inside the wall; got "
            f"{arena.birth_radius_m:g}"
        )


def _arena_clock_problems(arena: ArenaSection, clock: Simulation) -> Iterator[str]:
    """Yield which interval does not end on both a brain tick and a pose."""
    for name in ("founder", "birth", "cull", "sample", "snapshot"):
        seconds: float = getattr(arena, f"{name}_interval_s")
        steps = steps_of(seconds, clock)
        tick = lcm(clock.brain_steps, clock.pose_steps)
        is_whole = isclose(steps * clock.timestep_s, seconds, rel_tol=1e-9)
        if not (steps and is_whole) or steps % tick:
            yield (
                f"arena.{name}_interval_s: must be a whole multiple of "
                f"{tick * clock.timestep_s:g} s, the common multiple of "
                f"simulation.brain_steps and pose_steps, got {seconds:g}"
            )
    yield from pose_problems(clock, "warmup_steps")


def _infancy_problems(clock: Simulation) -> Iterator[str]:
    """Yield which part of an infant's trials does not end on a brain tick."""
    for name in ("warmup_steps", "window_steps"):
        steps: int = getattr(clock, name)
        if steps % clock.brain_steps:
            yield (
                f"simulation.{name}: must be a multiple of simulation.brain_steps = "
                f"{clock.brain_steps} with learning in an arena, got {steps}"
            )


def _culling_problems(experiment: Experiment) -> Iterator[str]:
    """Yield what is wrong with ``selection.culling``."""
    selection, where = experiment.selection, "selection.culling"
    rules = selection.culling
    if rules is None:
        return
    if experiment.arena is not None:
        yield f"{where}: arenas have these keys in [arena]; remove one of the two"
    if selection.survivors != "best" or not selection.keep_parents:
        yield (
            f"{where}: survival depends on fitness; selection.survivors must be "
            '"best" and selection.keep_parents true'
        )
    yield from _floor_problems(where, selection, rules)
    lowest = max(rules.population_floor + 1, selection.population)
    if rules.population_limit < lowest:
        yield (
            f"{where}.population_limit: must be > population_floor and >= "
            f"selection.population, {lowest}, got {rules.population_limit}"
        )
    if round(rules.full_cull_share * rules.population_limit) < 1:
        yield (
            f"{where}.full_cull_share: must remove at least one robot of "
            f"population_limit = {rules.population_limit}, "
            f"got {rules.full_cull_share:g}"
        )


def _floor_problems(
    where: str, selection: SelectionSection, rules: ArenaSection | Culling
) -> Iterator[str]:
    needed = selection.parents_needed
    if rules.population_floor < needed:
        how = f"tournament_size = {selection.tournament_size}"
        by = f" with {how}" if selection.parents == "tournament" else ""
        yield (
            f"{where}.population_floor: must be >= {needed}, so that there are always "
            f"two parents to choose{by}, got {rules.population_floor}"
        )


def _reevaluation_problems(experiment: Experiment) -> Iterator[str]:
    """Yield what is wrong with ``selection.reevaluation``."""
    selection, where = experiment.selection, "selection.reevaluation"
    if selection.reevaluation is None:
        return
    if experiment.arena is not None:
        yield f"{where}: arenas re-evaluate all the time; remove one of the two"
    if not selection.keep_parents:
        yield (
            f"{where}: no individual outlives its brood if selection.keep_parents is "
            "false"
        )


def _duration_problems(experiment: Experiment) -> Iterator[str]:
    """Yield what is wrong with ``simulation.evaluation_s``."""
    clock, where = experiment.simulation, "simulation.evaluation_s"
    if clock.evaluation_s is None:
        return
    shortest, longest = clock.evaluation_s
    if experiment.arena is not None:
        yield f"{where}: not for arenas, which evaluate all the time; remove it"
    least = clock.evaluation_steps * clock.timestep_s
    if steps_of(shortest, clock) < clock.evaluation_steps:
        yield (
            f"{where}: must be >= {least:g} s, warmup_steps and window_steps "
            f"together, got {shortest:g}"
        )
    if longest < shortest:
        yield f"{where}: must be [shortest, longest], got [{shortest:g}, {longest:g}]"
