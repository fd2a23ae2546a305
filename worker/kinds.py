"""Kinds of plug-ins that workers run: fitness functions."""

import inspect
from collections.abc import Iterator

import worker.fitness
from schema.experiment.document import Experiment, Fitness
from schema.experiment.kinds import Kind, Use
from schema.experiment.settings import fitness_function
from worker.fitness import check_fitness


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


def _is_fitness(plugin: object) -> bool:
    if not inspect.isfunction(plugin):
        return False
    try:
        inspect.signature(plugin).bind(None, None)
    except TypeError:
        return False
    return True


FITNESS = Kind(
    "fitness",
    {"worker.fitness:thesis": worker.fitness.thesis},
    _is_fitness,
    lambda path: fitness_use(Fitness(function=path)),
    _fitness_functions,
)
KINDS = (FITNESS,)
