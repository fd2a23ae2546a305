"""Kinds of plug-ins of the worker, and settings with checked plug-ins."""

from collections.abc import Iterator
from functools import lru_cache, partial
from typing import TypeVar

import worker.fitness
from schema.experiment.document import Fitness, Measures, body_space
from schema.experiment.kinds import Kind, Use, sections_of, takes
from schema.experiment.settings import (
    FITNESS,
    ArenaSettings,
    EvaluationSettings,
    fitness_function,
)
from schema.plugins.simple_traces import check_function
from worker.fitness import load_fitness
from worker.measures import BUILT_IN, measures_of


def single_measures(measures: Measures) -> Iterator[Measures]:
    """Yield a section for each measure of a section."""
    for name, label in zip(measures.names, measures.labels, strict=True):
        table = measures.parameters.get(label)
        parameters = {} if table is None else {label: table}
        yield Measures(names=(name,), parameters=parameters)


def check_fitness(fitness: Fitness) -> None:
    """Raise unless the fitness function of a section keeps its contract."""
    loaded = load_fitness(fitness)
    check_function(loaded.function, *loaded.arguments)


def check_measures(measures: Measures) -> None:
    """Raise unless the measures of a section keep their contract."""
    for measure in measures_of(measures):
        check_function(measure.function, *measure.arguments)


FITNESS_KIND = Kind(
    "fitness",
    "fitness.function",
    {
        "worker.fitness:thesis": worker.fitness.thesis,
        **{name: fitness_function(Fitness(function=name)) for name in FITNESS},
    },
    is_one=partial(takes, 2),
    section=lambda path: Fitness(function=path),
    sections=lambda experiment: sections_of(experiment, "fitness"),
    path=lambda fitness: fitness.function,
    load=fitness_function,
    check=check_fitness,
)
MEASURE_KIND = Kind(
    "measure",
    "measures.names",
    BUILT_IN,
    # One with parameters looks like a fitness function: ``--kind`` says that it is not.
    is_one=partial(takes, 1),
    section=lambda path: Measures(names=(path,)),
    sections=lambda experiment: single_measures(experiment.measures),
    path=lambda measures: measures.names[0],
    load=lambda measures: measures_of(measures)[0].function,
    check=check_measures,
)
KINDS = (FITNESS_KIND, MEASURE_KIND)


T = TypeVar("T", EvaluationSettings, ArenaSettings)


@lru_cache(maxsize=64)
def checked(settings: T) -> T:
    """Return the settings of a request, with checked plug-ins.

    Raises:
        ExperimentError: a plug-in cannot be loaded or breaks its contract.
    """
    body_space(settings.space)
    Use(FITNESS_KIND, settings.fitness).check()
    for measures in single_measures(settings.measures):
        Use(MEASURE_KIND, measures).check()
    return settings
