"""Own functions that select parents and survivors, and their parameters.

Built-in rules have short names; ``coordinator.evolution.selection`` holds them.
"""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from msgspec import Struct

from schema.errors import ExperimentError, shown
from schema.experiment.document import PARENTS, SURVIVORS, SelectionSection
from schema.plugins.load import load_function, unknown
from schema.plugins.origin import where_defined
from schema.plugins.parameters import parameters_type, read_parameters

_ARGUMENTS = {"parents": 3, "survivors": 4}
_NAMES = {"parents": PARENTS, "survivors": SURVIVORS}


def own_rule(
    selection: SelectionSection, name: str
) -> tuple[Callable[..., Any], Any] | None:
    """Return an own rule for ``parents`` or ``survivors``, and its parameters.

    None is a built-in rule.

    Raises:
        ExperimentError: no such function of so many arguments, or other parameters
            than it declares.
    """
    path, key = getattr(selection, name), f"selection.{name}"
    if ":" not in path:
        return None
    function = load_function(path, key, _ARGUMENTS[name])
    table = getattr(selection, f"{name}_parameters")
    return function, _parameters(function, table, key)


def _parameters(
    function: Callable[..., Any], table: Mapping[str, Any], key: str
) -> Struct | None:
    """Return parameters as the Struct with which the last argument is annotated."""
    place = where_defined(function)
    kind = parameters_type(function, f"{key}: {place}", position=-1)
    if kind is not None:
        return read_parameters(table, kind, f"{key}_parameters")
    if table:
        raise ExperimentError(
            f"{key}_parameters: {place}: must annotate its last "
            f"argument with a msgspec Struct to get parameters, got {shown(table)}"
        )
    return None


def rule_problems(selection: SelectionSection) -> Iterator[str]:
    """Yield what is wrong with the rules of a section."""
    for name, built_in in _NAMES.items():
        path = getattr(selection, name)
        if ":" in path:
            own_rule(selection, name)
        elif path not in built_in:
            yield str(unknown(path, f"selection.{name}", built_in))
        elif table := getattr(selection, f"{name}_parameters"):
            yield (
                f"selection.{name}_parameters: {path!r} has no parameters, got "
                f"{shown(table)}"
            )
