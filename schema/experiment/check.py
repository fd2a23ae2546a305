"""Checks that the sections of an experiment are consistent."""

from collections.abc import Iterator
from itertools import chain
from math import ceil
from urllib.parse import quote

from schema.errors import ExperimentError, naming, nearest, shown
from schema.experiment.brains import neuron_kinds
from schema.experiment.check_island import island_problems
from schema.experiment.document import (
    Experiment,
    Measures,
    body_space,
    is_lit,
    island_count,
    island_experiment,
    island_experiments,
)
from schema.experiment.grid import grid_problems
from schema.experiment.migration import Migration, migrant_count
from schema.experiment.robust import calibration_problems
from schema.experiment.selection_rules import rule_problems, varies
from schema.parts import BodySpace, Sensor

_UNCONNECTED = """migration.topology: unconnected islands cannot exchange migrants; \
choose another topology, or remove the other keys of [migration]"""

# File systems hold names of 255 bytes, of which the run's folders need some.
_LONGEST_NAME = 200


def check_experiment(experiment: Experiment, where: str) -> None:
    """Raise ``ExperimentError``, with file and key, unless sections are consistent."""
    with naming(where):
        if problem := next(_problems(experiment), ""):
            raise ExperimentError(problem)


def _problems(experiment: Experiment) -> Iterator[str]:
    """Yield what is wrong with an experiment; each check relies on those before it."""
    for where, own in _each_island(experiment):
        for problem in island_problems(own):
            yield f"{where}{problem}"
    yield from _name_problems(experiment.name)
    yield from _migration_problems(experiment)
    yield from _measures_problems(experiment.measures)
    if experiment.grid is not None:
        yield from grid_problems(experiment.grid, experiment.measures.labels)
    types = body_space(experiment.space)
    core = next(kind for kind in types.values() if kind.is_root)
    if core.inputs > experiment.space.max_inputs:
        rule = f"must be >= {core.inputs}, the inputs of {core.name}"
        yield f"space.max_inputs: {rule}, got {experiment.space.max_inputs}"
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
    needs = "needs environment.light = [x, y, z], got none"
    problem = f"space.part_types: the light sensor of {shown(sensing[0])} {needs}"
    for where, own in _each_island(experiment):
        if not is_lit(own.environment, own.arena):
            yield f"{where}{problem}"


def _each_island(experiment: Experiment) -> Iterator[tuple[str, Experiment]]:
    """Yield where the settings of equal islands stand, and these settings."""
    if not experiment.islands:
        yield "", experiment
    first = 0
    for index, islands in enumerate(experiment.islands):
        yield f"islands[{index}]: ", island_experiment(experiment, first)
        first += islands.count


def _measures_problems(measures: Measures) -> Iterator[str]:
    """Yield what is wrong with ``measures``; names are looked up elsewhere."""
    labels = measures.labels
    for label in labels:
        if labels.count(label) > 1:
            yield f"measures.names: two measures are named {shown(label)}"
    for label in measures.parameters:
        if label not in labels:
            near = nearest(label, labels)
            yield f"measures.parameters.{shown(label)}: not in measures.names{near}"


def _name_problems(name: str) -> Iterator[str]:
    """Yield what is wrong with a name: it becomes the name of a folder."""
    if not name.strip():
        yield f"name: must not be empty, got {name!r}"
    if not name.isprintable():
        yield f"name: must be printable, got {name!r}"
    length = len(quote(name, safe=""))
    if length > _LONGEST_NAME:
        yield f"name: must be <= {_LONGEST_NAME} bytes after encoding, got {length}"


def _migration_problems(experiment: Experiment) -> Iterator[str]:
    """Yield what is wrong with the migration of an otherwise consistent experiment."""
    migration, count = experiment.migration, island_count(experiment)
    if migration is None:
        if any(islands.migration for islands in experiment.islands):
            yield "migration: is missing; [[islands]] with a migration need it"
        return
    if migration.topology == "unconnected":
        if migration != Migration():
            yield _UNCONNECTED
        return
    if count == 1:
        yield "migration: needs at least two islands; add [[islands]]"
    yield from _edges_problems(migration, count)
    yield from _degree_problems(migration, count)
    islands = island_experiments(experiment)
    for number, island in enumerate(islands):
        yield from _emigration_problems(island, migration, number)
    if migration.epoch_s is not None and not any(island.arena for island in islands):
        yield "migration.epoch_s: applies to arenas only, and the experiment has none"


def _edges_problems(migration: Migration, count: int) -> Iterator[str]:
    edges = migration.edges
    if migration.topology != "edges" and edges:
        yield 'migration.edges: needs topology = "edges"'
    if migration.topology == "edges" and not edges:
        yield "migration.edges: must be pairs of islands, got none"
    for edge in edges:
        if max(edge) >= count:
            yield f"migration.edges: islands are 0..{count - 1}, got {list(edge)}"
        if edge[0] == edge[1]:
            yield f"migration.edges: must be two islands, got {list(edge)}"
        if edges.count(edge) > 1:
            yield f"migration.edges: must not repeat a pair, got {list(edge)} twice"


def _degree_problems(migration: Migration, count: int) -> Iterator[str]:
    if migration.topology not in ("random-regular", "small-world"):
        return
    degree = migration.degree
    lowest = 1 if migration.topology == "random-regular" else 2
    if not lowest <= degree < count:
        rule = f"must be >= {lowest} and < {count}, the number of islands"
        yield f"migration.degree: {rule}, got {degree}"
    if migration.topology == "random-regular" and degree * count % 2:
        yield f"migration.degree: must be even for {count} islands, got {degree}"
    if migration.topology == "small-world" and degree % 2:
        yield f"migration.degree: must be even in a small world, got {degree}"


def _emigration_problems(
    own: Experiment, connected: Migration, number: int
) -> Iterator[str]:
    assert own.migration is not None
    for name in ("topology", "degree", "p_rewire", "edges"):
        if getattr(own.migration, name) != getattr(connected, name):
            yield f"migration.{name}: must be the same on all islands"
    yield from rule_problems(own.migration)
    if connected.topology == "edges" and number not in chain(*connected.edges):
        return
    for problem in _exchange_problems(own, own.migration):
        yield f"{problem} (island {number})"


def _exchange_problems(own: Experiment, migration: Migration) -> Iterator[str]:
    selection, arena = own.selection, own.arena
    founders, epoch = selection.population, migration.epoch
    first = max(epoch, founders)
    if arena is None:
        broods = ceil((first - founders) / selection.children)
        first = founders + broods * selection.children
    if first >= own.births and (arena is None or migration.epoch_s is None):
        end = f"the first of {epoch} births would end with birth {first}"
        yield f"migration.epoch: {end}, but the island ends with birth {own.births}"
    living = selection.population if arena is None else arena.population_limit
    if migrant_count(migration, living) == 0:
        yield f"migration.migrants: {migration.migrants:g} of {living} rounds to 0"
    if isinstance(migration.migrants, int) and migration.migrants > living:
        rule = f"must be <= {living}, the population of the island"
        yield f"migration.migrants: {rule}, got {migration.migrants}"
    stay = selection.parents_needed
    if migration.handling == "evict" and living <= stay:
        yield (
            f'migration.handling: "evict" keeps at least {stay} robots on an island, '
            f"and at most {living} live there"
        )
    if migration.replaced == "none" and not (arena or selection.culling):
        only = "off-line it varies only with selection.culling"
        yield f'migration.replaced: "none" needs a varying population; {only}'
    if migration.replaced == "rule" and (arena or selection.culling):
        yield 'migration.replaced: "rule" is for islands off-line without culling'
    if migration.replaced != "rule" and varies(selection):
        yield f'migration.replaced: must be "rule" with {shown(selection.survivors)}'
