"""Check that the keys of ``[fitness]`` have an effect on the experiment's function."""

from collections.abc import Callable
from contextlib import suppress
from typing import Any

from schema.errors import ExperimentError
from schema.experiment.document import Fitness
from schema.experiment.settings import fitness_argument, fitness_function
from schema.plugins.simple_traces import simple_traces

_KEYS = ("path_weight", "straight_weight", "limit")
_TABLE = "fitness.parameters"


def check_fitness_keys(fitness: Fitness) -> None:
    """Raise if a key that was changed has no effect.

    A run that was started before this check keeps its keys: it is not part of
    ``check_experiment``.

    Args:
        fitness: the section; its function is called.

    Raises:
        ExperimentError: the function has parameters of its own, or does not read the
            key; errors of ``fitness_argument``.
    """
    changed = [key for key in _KEYS if getattr(fitness, key) != _default(key)]
    if not changed:
        return
    function = fitness_function(fitness)
    name = fitness.function
    if fitness_argument(function, fitness) is not fitness:
        raise ExperimentError(
            f"fitness.{changed[0]}: has no effect on {name}, which reads "
            f"[{_TABLE}]: move the key there, or remove it"
        )
    read = _keys_read(function, fitness)
    for key in changed:
        if key not in read:
            raise ExperimentError(
                f"fitness.{key}: has no effect on {name}, which does not read it: "
                f"remove the key, or let the function use it (parameters.{key})"
            )


def _default(key: str) -> float:
    return float(getattr(Fitness(), key))


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
