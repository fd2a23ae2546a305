"""Own rules that select parents, survivors and emigrants, and their parameters.

Built-in rules have short names; ``coordinator.evolution.selection`` holds them.
"""

from collections.abc import Callable, Iterator
from typing import Any

from schema.errors import ExperimentError, shown
from schema.experiment.brains import NoParameters
from schema.experiment.document import PARENTS, SURVIVORS, SelectionSection
from schema.experiment.migration import EMIGRANTS, Migration
from schema.plugins.load import load_function, load_object, unknown
from schema.plugins.origin import where_defined
from schema.plugins.parameters import parameters_type, read_parameters

RuleSection = SelectionSection | Migration
METHODS = ("select", "update")
"""Methods of a rule that is a class."""
_ARGUMENTS = {"parents": 3, "survivors": 4, "emigrants": 4}
NAMES = {"parents": PARENTS, "survivors": SURVIVORS, "emigrants": EMIGRANTS}
"""Built-in rules of each kind."""
_FUNCTIONS = {"tournament", "random", "none", "best"}
"""Built-in rules without parameters."""


def rule_key(name: str) -> str:
    """Return the key of the experiment that names ``parents``, for example."""
    return f"{'migration' if name == 'emigrants' else 'selection'}.{name}"


def own_rule(section: RuleSection, name: str) -> tuple[Callable[..., Any], Any] | None:
    """Return an own rule for ``parents``, for example, and its parameters.

    It is a function or a class; None is a built-in rule.

    Raises:
        ExperimentError: no such rule, or other parameters than it declares.
    """
    path, key = getattr(section, name), rule_key(name)
    if ":" not in path:
        return None
    table = getattr(section, f"{name}_parameters")
    rule: Any = load_object(path, key, {})
    if isinstance(rule, type):
        load_object(path, key, {}, METHODS)
        declared = getattr(rule, "Parameters", None)
        read = read_parameters(table, declared or NoParameters, f"{key}_parameters")
        return rule, read if declared else None
    function = load_function(path, key, _ARGUMENTS[name])
    place = where_defined(function)
    kind = parameters_type(function, f"{key}: {place}", position=-1)
    if kind is not None:
        return function, read_parameters(table, kind, f"{key}_parameters")
    if table:
        rule = "must annotate its last argument with a msgspec Struct"
        got = f"to get parameters, got {shown(table)}"
        raise ExperimentError(f"{key}_parameters: {place}: {rule} {got}")
    return function, None


def varies(selection: SelectionSection) -> bool:
    """Return whether the survivors are as many as their rule likes."""
    own = own_rule(selection, "survivors")
    is_varying = own is not None and getattr(own[0], "varies", False) is True
    return is_varying or selection.survivors == "map-elites"


def rule_problems(section: RuleSection) -> Iterator[str]:
    """Yield what is wrong with the rules of a section."""
    for name, built_in in NAMES.items():
        path = getattr(section, name, None)
        if path is None:
            continue
        if ":" in path:
            own_rule(section, name)
        elif path not in built_in:
            yield str(unknown(path, rule_key(name), built_in))
        elif path in _FUNCTIONS and (table := getattr(section, f"{name}_parameters")):
            why = f"{path!r} has no parameters, got {shown(table)}"
            yield f"{rule_key(name)}_parameters: {why}"
