"""Own functions that select parents and survivors, and their parameters.

Built-in rules have short names; ``coordinator.evolution.selection`` holds them.
"""

from collections.abc import Callable, Iterator
from typing import Any

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
        ExperimentError: no such function, or other parameters than it declares.
    """
    path, key = getattr(selection, name), f"selection.{name}"
    if ":" not in path:
        return None
    function = load_function(path, key, _ARGUMENTS[name])
    table, place = getattr(selection, f"{name}_parameters"), where_defined(function)
    kind = parameters_type(function, f"{key}: {place}", position=-1)
    if kind is not None:
        return function, read_parameters(table, kind, f"{key}_parameters")
    if table:
        rule = "must annotate its last argument with a msgspec Struct"
        got = f"to get parameters, got {shown(table)}"
        raise ExperimentError(f"{key}_parameters: {place}: {rule} {got}")
    return function, None


def rule_problems(selection: SelectionSection) -> Iterator[str]:
    """Yield what is wrong with the rules of a section."""
    for name, built_in in _NAMES.items():
        path = getattr(selection, name)
        if ":" in path:
            own_rule(selection, name)
        elif path not in built_in:
            yield str(unknown(path, f"selection.{name}", built_in))
        elif table := getattr(selection, f"{name}_parameters"):
            why = f"{path!r} has no parameters, got {shown(table)}"
            yield f"selection.{name}_parameters: {why}"
