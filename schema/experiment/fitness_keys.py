"""The section ``[fitness]``: a check that its keys have an effect, and its text.

The text tells whose fitness is comparable.
"""

import json
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from itertools import pairwise
from typing import Any

from msgspec import to_builtins

from schema.errors import ExperimentError, naming
from schema.experiment.changes import OF_FITNESS, between, with_value
from schema.experiment.document import Experiment, Fitness, island_experiments
from schema.experiment.settings import FITNESS, fitness_argument, fitness_function
from schema.plugins.permission import ROOMS
from schema.plugins.simple_traces import simple_traces

_KEYS = ("path_weight", "straight_weight", "limit")
_SHORT = {path: name for name, path in FITNESS.items()}
_DEFAULTS: dict[str, Any] = to_builtins(Fitness())


def check_fitness_keys(experiment: Experiment) -> None:
    """Raise if a key of one island has no effect, or a change is not allowed.

    The function is called.

    Raises:
        ExperimentError: a key with another value than the default that has no effect;
            errors of ``fitness_argument``, also for values of ``changes``.
    """
    _check_changes(experiment)
    fitness = experiment.fitness
    changed = [key for key in _KEYS if getattr(fitness, key) != _DEFAULTS[key]]
    if not changed:
        return
    function = fitness_function(fitness)
    name = fitness.function
    if not isinstance(fitness_argument(function, fitness), Fitness):
        why = f"has no effect on {name}, which reads [fitness.parameters]"
        raise ExperimentError(f"fitness.{changed[0]}: {why}: move the key or remove it")
    read = _keys_read(function, fitness)
    for key in changed:
        if key not in read:
            why = f"has no effect on {name}, which does not read it"
            how = f"remove the key, or let the function use it (parameters.{key})"
            raise ExperimentError(f"fitness.{key}: {why}: {how}")


def _check_changes(experiment: Experiment) -> None:
    for number, change in enumerate(experiment.changes):
        if not change.setting.startswith(OF_FITNESS):
            continue
        values = [*change.values]
        if change.between == "linear":
            # No whole number lies there, should the function want one.
            values += [between(*pair, 0.41) for pair in pairwise(change.values)]
        for value in values:
            fitness = with_value(experiment, change.setting, value).fitness
            with naming(f"changes[{number}].values"):
                fitness_argument(fitness_function(fitness), fitness)


class _Watched:
    """Fitness section that notes which of its keys are read."""

    def __init__(self, fitness: Fitness) -> None:
        self._fitness = fitness
        self.read: set[str] = set()

    def __getattr__(self, name: str) -> Any:  # noqa: ANN401 - of any key
        self.read.add(name)
        return getattr(self._fitness, name)


def _keys_read(function: Callable[..., float], fitness: Fitness) -> set[str]:
    """Return the keys that a function reads on simple traces; all if it raises."""
    watched, is_called = _Watched(fitness), False
    for trace in simple_traces(function).values():
        with suppress(Exception):
            function(trace, watched)
            is_called = True
    return watched.read if is_called else set(_KEYS)


def fitness_text(
    experiment: Experiment, digests: Mapping[str, str] | None = None
) -> str:
    """Return the fitness functions of an experiment, with what changes their values.

    Fitness has the same meaning in two experiments, or those of one island, if these
    texts are equal. Digests are of the sources of plug-ins, by module; None leaves them
    out.

    For example ``locomotion``, ``locomotion (limit = 2.0)`` or ``goals:fast (source
    6f1d2a)``; several functions of islands with ``and`` between. Keys with default
    values are left out.
    """
    sections = (each.fitness for each in island_experiments(experiment))
    return " and ".join(dict.fromkeys(_text(each, digests) for each in sections))


def _text(fitness: Fitness, digests: Mapping[str, str] | None) -> str:
    function = fitness.function
    notes = list(_changed(to_builtins(fitness), _DEFAULTS))
    module = function.partition(":")[0].partition(".")[0]
    if digests is not None and ":" in function and module not in ROOMS:
        notes.append(f"source {digests.get(module, 'unknown')}")
    name = _SHORT.get(function, function)
    return f"{name} ({', '.join(notes)})" if notes else name


def _changed(entries: Mapping[str, Any], usual: Mapping[str, Any]) -> Iterator[str]:
    """Yield ``key = value`` for each key but the function whose value is not usual."""
    for key in sorted(entries):
        value = entries[key]
        if key == "parameters":
            yield from _changed(value, {})
        elif key != "function" and value != usual.get(key):
            yield f"{key} = {json.dumps(value, sort_keys=True)}"
