"""Checks that the sections of one island are consistent."""

from collections.abc import Iterator
from math import lcm
from operator import attrgetter

from schema.errors import ExperimentError, nearest, shown
from schema.experiment.changes import change_problems
from schema.experiment.document import (
    FOUNDERS,
    REVOLVE_ANGLE,
    ArenaSection,
    Culling,
    Experiment,
    Founders,
    SelectionSection,
    light_of,
    steps_of,
)
from schema.experiment.environment import ground_problems
from schema.experiment.learning import LEARNERS
from schema.experiment.robust import ordered, range_problems
from schema.experiment.section import multiple_problems
from schema.experiment.selection_rules import rule_problems
from schema.experiment.settings import FITNESS, arena_problems
from schema.plugins.load import unknown
from schema.robot.modular import MODULE_NEURONS


def island_problems(experiment: Experiment) -> Iterator[str]:
    """Yield what is wrong with one island; each check relies on those before it."""
    arena, culling = experiment.arena, experiment.selection.culling
    yield from _limits_problems(experiment)
    yield from _selection_problems(experiment)
    if culling is not None:
        yield from _death_problems(experiment, "selection.culling", culling, 1)
        if round(culling.full_cull_share * culling.population_limit) < 1:
            rule = f"must remove at least one robot of {culling.population_limit}"
            share = f"selection.culling.full_cull_share: {rule}"
            yield f"{share}, got {culling.full_cull_share:g}"
    yield from _clock_problems(experiment)
    yield from ground_problems(experiment.environment)
    yield from _scenery_problems(experiment)
    yield from _push_problems(experiment)
    yield from _light_problems(experiment)
    yield from range_problems(experiment.robust)
    yield from change_problems(experiment)
    yield from _learning_problems(experiment)
    if experiment.brain.type == "modular":
        yield from _modular_problems(experiment)
    if (founders := experiment.founders) is not None:
        yield from _founders_problems(founders, experiment.selection.population)
    if arena is not None:
        yield from arena_problems(experiment)
        yield from _death_problems(experiment, "arena", arena, 0)
        yield from _arena_problems(experiment, arena)


def _limits_problems(experiment: Experiment) -> Iterator[str]:
    pairs = [("space.min_parts", "space.max_parts"), ("selection.population", "births")]
    if experiment.selection.window is not None:
        pairs.append(("selection.window", "selection.children"))
    if not experiment.selection.keep_parents:
        pairs.append(("selection.population", "selection.children"))
    if experiment.arena is not None:
        pairs.append(("arena.merge_distance_m", "arena.split_distance_m"))
    for lower, upper in pairs:
        low, high = attrgetter(lower, upper)(experiment)
        if low > high:
            yield f"{upper}: must be >= {lower} = {low:g}, got {high:g}"
    if experiment.space.max_parts == 1:
        yield "space.max_parts: must be > 1, got 1"


def _selection_problems(experiment: Experiment) -> Iterator[str]:
    selection = experiment.selection
    yield from rule_problems(selection)
    if selection.population < selection.parents_needed:
        yield f"selection.population: {_by(selection)}, got {selection.population}"
    if selection.reevaluation is not None and not selection.keep_parents:
        why = "no individual outlives its brood if keep_parents is false"
        yield f"selection.reevaluation: {why}"


def _by(selection: SelectionSection) -> str:
    """Return how many robots are needed to choose parents from, and why."""
    rule = f"must be >= {selection.parents_needed}, to choose two parents"
    if selection.parents_needed != selection.tournament_size + 1:
        return rule
    return f"{rule} with tournament_size = {selection.tournament_size}"


def _death_problems(
    experiment: Experiment, where: str, rules: ArenaSection | Culling, spare: int
) -> Iterator[str]:
    selection = experiment.selection
    if selection.survivors != "best" or not selection.keep_parents:
        rule = 'selection.survivors must be "best" and keep_parents true'
        yield f"{where}: survival depends on fitness; {rule}"
    if rules.population_floor < selection.parents_needed:
        got = f"got {rules.population_floor}"
        yield f"{where}.population_floor: {_by(selection)}, {got}"
    lowest = max(rules.population_floor + spare, selection.population)
    if rules.population_limit < lowest:
        rule = f"must be >= {lowest}, for population_floor and selection.population"
        yield f"{where}.population_limit: {rule}, got {rules.population_limit}"


def _clock_problems(experiment: Experiment) -> Iterator[str]:
    clock, is_arena = experiment.simulation, experiment.arena is not None
    units = {"pose_steps": clock.pose_steps}
    if is_arena and experiment.learning is not None:
        # Trials of infants end at brain ticks.
        units["brain_steps"] = clock.brain_steps
    for unit, steps in units.items():
        for name in ("window_steps", "warmup_steps") if is_arena else ("window_steps",):
            key, value = f"simulation.{name}", getattr(clock, name)
            yield from multiple_problems(key, value, steps, f"simulation.{unit}")
    for number, entry in enumerate(experiment.calibration):
        for what in ("sensor", "motor"):
            key, delay_s = f"calibration[{number}].{what}", getattr(entry, what).delay_s
            yield from multiple_problems(
                f"{key}.delay_s", delay_s, clock.tick_s, "the time between brain ticks"
            )
    if clock.evaluation_s is None:
        return
    shortest, _ = clock.evaluation_s
    if steps_of(shortest, clock) < clock.evaluation_steps:
        least = clock.evaluation_steps * clock.timestep_s
        rule = f"must be >= {least:g} s, warmup_steps and window_steps together"
        yield f"simulation.evaluation_s: {rule}, got {shortest:g}"
    yield from ordered("simulation.evaluation_s", clock.evaluation_s)


def _arena_problems(experiment: Experiment, arena: ArenaSection) -> Iterator[str]:
    radius_m = 0.5 * arena.wall_diameter_m
    if 0.0 < radius_m <= arena.birth_radius_m:
        rule = f"must be less than half of wall_diameter_m, {radius_m:g} m"
        why = "as robots are born inside the wall"
        yield f"arena.birth_radius_m: {rule}, {why}; got {arena.birth_radius_m:g}"
    clock = experiment.simulation
    tick_s = lcm(clock.brain_steps, clock.pose_steps) * clock.timestep_s
    shared = "the common multiple of simulation.brain_steps and pose_steps"
    for name in ("founder", "birth", "cull", "sample", "snapshot"):
        key = f"{name}_interval_s"
        value = getattr(arena, key)
        yield from multiple_problems(f"arena.{key}", value, tick_s, shared)


def _learning_problems(experiment: Experiment) -> Iterator[str]:
    learning = experiment.learning
    if learning is None:
        return
    if ":" not in learning.learner and learning.learner not in LEARNERS:
        yield str(unknown(learning.learner, "learning.learner", LEARNERS))
    if learning.weight_limits is not None:
        low, high = learning.weight_limits
        if low == high:
            yield f"learning.weight_limits: must be two numbers, got {low:g} twice"
        yield from ordered("learning.weight_limits", learning.weight_limits)
    if learning.budget <= learning.samples:
        rule = f"must be > {learning.samples}, the samples of parents and peers"
        yield f"learning.budget: {rule}, got {learning.budget}"
    if experiment.selection.reevaluation is not None:
        yield "learning: cannot be combined with selection.reevaluation; remove one"
    if experiment.encoding.type == "cppn" and learning.inherit == "lamarckian":
        why = "no pattern can be made of a given brain"
        rule = "must be 'darwinian' with encoding.type = 'cppn'"
        yield f"learning.inherit: {rule}: {why}"
    if experiment.encoding.type == "cppn" and learning.samples:
        key = "peers" if learning.peers else "inherit"
        why = "samples need parts of known origin, and encoding.type = 'cppn' has none"
        yield f"learning.{key}: {why}"


def _modular_problems(experiment: Experiment) -> Iterator[str]:
    """Yield why a robot may not have a module in each part."""
    space, encoding = experiment.space, experiment.encoding.type
    least = MODULE_NEURONS * space.max_parts
    if encoding != REVOLVE_ANGLE:
        rule = f"must be {REVOLVE_ANGLE!r} with brain.type = 'modular'"
        yield f"encoding.type: {rule}, got {shown(encoding)}"
    if space.max_hidden < least:
        rule = f"must be >= {least} with brain.type = 'modular', {MODULE_NEURONS} for"
        parts = f"each of space.max_parts = {space.max_parts} parts"
        yield f"space.max_hidden: {rule} {parts}, got {space.max_hidden}"


def _founders_problems(founders: Founders, population: int) -> Iterator[str]:
    sources = {key: getattr(founders, key) for key in ("files", "run", "genomes")}
    named = [f"founders.{key}" for key, value in sources.items() if value]
    if not named:
        yield "founders: must name files or a run"
    if len(named) > 1:
        yield f"{named[1]}: cannot be combined with {named[0]}; remove one"
    given, rule = founders.population, f"selection.population = {population}"
    if not founders.run and (founders.island, given) != (None, "last"):
        yield "founders: island and population need founders.run"
    if not isinstance(given, str) and not 1 <= len(given) <= population:
        yield f"founders.population: must be 1 to {rule} births, got {len(given)}"
    if isinstance(given, str) and given not in FOUNDERS:
        got = f"got {shown(given)}{nearest(given, FOUNDERS)}"
        names = ", ".join(map(repr, FOUNDERS))
        yield f"founders.population: must be {names} or a list of births, {got}"
    if len(founders.files) > population:
        yield f"founders.files: must be <= {rule}, got {len(founders.files)}"


def _scenery_problems(experiment: Experiment) -> Iterator[str]:
    if scenery := experiment.environment.scenery:
        # MuJoCo is imported only if needed: it is slow to load.
        from schema.experiment.scenery import refuse_objects, scenery_model  # noqa: PLC0415

        try:
            scenery_model(scenery, experiment.simulation)
            if experiment.arena is not None:
                refuse_objects(experiment.environment, experiment.simulation)
        except ExperimentError as error:
            yield str(error)


def _push_problems(experiment: Experiment) -> Iterator[str]:
    """Yield whether pushes do not begin at a tick, or never begin."""
    world, clock = experiment.environment, experiment.simulation
    if not world.push_impulse:
        return
    key, interval_s = "environment.push_interval_s", world.push_interval_s
    ticks = "the time between brain ticks"
    yield from multiple_problems(key, interval_s, clock.tick_s, ticks)
    longest_s = clock.evaluation_steps * clock.timestep_s
    if clock.evaluation_s is not None:
        longest_s = clock.evaluation_s[1]
    if steps_of(interval_s, clock) >= steps_of(longest_s, clock):
        rule = f"must be < {longest_s:g} s, the longest evaluation, for a push"
        yield f"{key}: {rule}, got {interval_s:g}"


def _light_problems(experiment: Experiment) -> Iterator[str]:
    arena, there = experiment.arena, experiment.environment.light
    function = experiment.fitness.function
    needs_light = function in ("light", FITNESS["light"])
    if needs_light and not light_of(experiment.environment, arena):
        needs = "needs environment.light = [x, y, z], got none"
        yield f"fitness.function: {shown(function)} {needs}"
    here = None if arena is None else arena.light
    if here and there and here != there:
        differs = f"differs from environment.light = {list(there)}, got {list(here)}"
        yield f"arena.light: {differs}; remove one of the two"
