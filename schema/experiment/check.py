"""Checks that the sections of an experiment are consistent."""

from collections.abc import Iterator
from contextlib import contextmanager
from urllib.parse import quote

from schema.errors import ExperimentError, nearest, shown
from schema.experiment.brains import neuron_kinds
from schema.experiment.check_island import island_problems
from schema.experiment.check_migration import migration_problems
from schema.experiment.document import (
    Experiment,
    Measures,
    body_space,
    island_experiment,
    light_of,
)
from schema.experiment.robust import calibration_problems
from schema.parts import BodySpace, Sensor

# File systems hold names of 255 bytes, of which the run's folders need some.
_LONGEST_NAME = 200


def check_experiment(experiment: Experiment, where: str) -> None:
    """Raise unless the sections of an experiment are consistent.

    Raises:
        ExperimentError: the first thing that is wrong, with file and key.
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
        for problem in island_problems(own):
            yield f"{where}{problem}"
    yield from _name_problems(experiment.name)
    yield from migration_problems(experiment)
    yield from _measures_problems(experiment.measures)
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
