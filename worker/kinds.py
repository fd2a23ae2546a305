"""Kinds of plug-ins that workers run: fitness functions and measures."""

import inspect
from collections.abc import Iterator

import worker.fitness
from schema.experiment.document import Experiment, Fitness, Measures
from schema.experiment.kinds import Kind, Use
from schema.experiment.settings import FITNESS, fitness_function
from schema.plugins.simple_traces import check_function
from worker.fitness import check_fitness
from worker.measures.functions import BUILT_IN, measures_of


def fitness_use(fitness: Fitness) -> Use:
    """Return the use of a fitness function, with its section."""
    return Use(
        "fitness.function",
        fitness.function,
        lambda: fitness_function(fitness),
        lambda function: check_fitness(function, fitness),
    )


def _fitness_functions(experiment: Experiment) -> Iterator[Use]:
    sections = (experiment.fitness, *(each.fitness for each in experiment.islands))
    for fitness in dict.fromkeys(filter(None, sections)):
        yield fitness_use(fitness)


def measure_use(measures: Measures) -> Use:
    """Return the use of a measure, the only one of a section."""
    return Use(
        "measures.names",
        measures.names[0],
        lambda: measures_of(measures)[0].function,
        lambda function: check_function(
            function, measures_of(measures)[0].arguments, "measures.names"
        ),
    )


def measure_uses(measures: Measures) -> Iterator[Use]:
    """Yield the use of each measure of a section."""
    for name, label in zip(measures.names, measures.labels, strict=True):
        tables = measures.parameters
        own = {label: tables[label]} if label in tables else {}
        yield measure_use(Measures(names=(name,), parameters=own))


def _takes(plugin: object, arguments: int) -> bool:
    """Return whether an object is a function of so many arguments."""
    if not inspect.isfunction(plugin):
        return False
    try:
        inspect.signature(plugin).bind(*[None] * arguments)
    except TypeError:
        return False
    return True


FITNESS_KIND = Kind(
    "fitness",
    {
        "worker.fitness:thesis": worker.fitness.thesis,
        **{name: fitness_function(Fitness(function=name)) for name in FITNESS},
    },
    lambda plugin: _takes(plugin, 2),
    lambda path: fitness_use(Fitness(function=path)),
    _fitness_functions,
)
MEASURE_KIND = Kind(
    "measure",
    BUILT_IN,
    # One with parameters looks like a fitness function: ``--kind`` says that it is not.
    lambda plugin: _takes(plugin, 1),
    lambda path: measure_use(Measures(names=(path,))),
    lambda experiment: measure_uses(experiment.measures),
)
KINDS = (FITNESS_KIND, MEASURE_KIND)
