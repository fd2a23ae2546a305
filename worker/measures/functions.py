"""Fitness and measures that an experiment names, loaded, and their channels."""

from functools import lru_cache
from typing import Any

from schema.errors import ExperimentError
from schema.experiment.document import Measures
from schema.experiment.settings import ArenaSettings, EvaluationSettings
from schema.plugins.load import load_function, load_object
from schema.plugins.needs import channels_of
from schema.plugins.parameters import parameters_type, read_parameters
from schema.plugins.protocols import MeasureFunction
from worker.fitness import (
    Functions,
    TraceFunction,
    load_fitness,
    path_velocity,
    straight_velocity,
)
from worker.measures.built_in import (
    body_symmetry,
    contact_share,
    cost_of_transport,
    energy,
    height,
    joint_effort,
    turning,
)

BUILT_IN: dict[str, MeasureFunction] = {
    function.__name__: function
    for function in (
        path_velocity,
        straight_velocity,
        turning,
        energy,
        cost_of_transport,
        height,
        body_symmetry,
        joint_effort,
        contact_share,
    )
}
"""Measures by short name."""


@lru_cache(maxsize=64)
def measures_of(measures: Measures) -> tuple[TraceFunction, ...]:
    """Return the measures that an experiment names, in its order.

    Raises:
        UnknownPlugin: no such measure, or a module that is not allowed.
        ExperimentError: not a function, or parameters that it refuses.
    """
    labels = zip(measures.names, measures.labels, strict=True)
    return tuple(
        _measure(name, measures.parameters.get(label), f"measures.parameters.{label}")
        for name, label in labels
    )


def _measure(name: str, table: dict[str, Any] | None, where: str) -> TraceFunction:
    where_named = "measures.names"
    found = load_object(name, where_named, BUILT_IN)
    if not callable(found):
        raise ExperimentError(f"{where_named}: {name!r} is not a function")
    kind = parameters_type(found, where_named)
    if ":" in name:
        names = "trace" if kind is None else "trace, parameters"
        load_function(name, where_named, 1 if kind is None else 2, names)
    if kind is None:
        if table is not None:
            then = "it must annotate its second argument with a msgspec Struct"
            if name in BUILT_IN:
                then = "remove the table"
            raise ExperimentError(
                f"{where}: {name} has no parameters of its own; {then}"
            )
        return TraceFunction(f"measure {name}", found)
    parameters = read_parameters(table or {}, kind, where)
    return TraceFunction(f"measure {name}", found, (parameters,))


@lru_cache(maxsize=64)
def functions_of(settings: EvaluationSettings | ArenaSettings) -> Functions:
    """Return the functions that the settings of a request name.

    Raises:
        ExperimentError: an unknown function, or parameters that it refuses.
    """
    fitness, measures = load_fitness(settings.fitness), measures_of(settings.measures)
    functions = [fitness.function, *(each.function for each in measures)]
    return Functions(fitness, measures, channels_of(functions))
