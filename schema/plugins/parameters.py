"""Parameters of plug-ins: tables of an experiment, read as the plug-in's own Struct."""

import inspect
import math
from collections.abc import Callable, Mapping
from typing import Any, TypeVar

import msgspec

from schema.errors import ExperimentError, cut, expectation, nearest

T = TypeVar("T", bound=msgspec.Struct)


def read_parameters(table: Mapping[str, Any], kind: type[T], where: str) -> T:
    """Return a plug-in's parameters as its own Struct.

    Args:
        table: of the experiment.
        kind: the Struct that the plug-in declares; its defaults complete the table.
        where: the table's key, for messages, as ``fitness.parameters``.

    Raises:
        ExperimentError: an unknown or missing key, a value of another type or outside
            its range, or a number that is not finite.
    """
    names = [field.encode_name for field in msgspec.structs.fields(kind)]
    for name in table:
        if name not in names:
            allowed = ", ".join(names) or "none"
            raise ExperimentError(
                f"{where}.{cut(name)}: no such key{nearest(name, names)}; "
                f"allowed: {allowed}"
            )
    if path := _not_finite(table):
        raise ExperimentError(f"{where}.{path}: must be finite")
    try:
        return msgspec.convert(dict(table), kind)
    except msgspec.ValidationError as error:
        message, _, path = str(error).partition(" - at `$.")
        raise ExperimentError(
            f"{where}{'.' if path else ''}{path.rstrip('`')}: {expectation(message)}"
        ) from None


def parameters_type(
    function: Callable[..., Any], where: str, position: int = 1
) -> type[msgspec.Struct] | None:
    """Return the Struct with which the argument for parameters is annotated.

    Args:
        function: a fitness function, a measure or a rule of selection.
        where: the key that names it, for messages.
        position: of that argument: the second one of fitness functions and measures.

    Returns:
        The Struct; None if there is no second argument, or no Struct as annotation.

    Raises:
        ExperimentError: the annotation is a text that names nothing.
    """
    try:
        arguments = inspect.signature(function, eval_str=True).parameters
    except NameError as error:
        raise ExperimentError(f"{where}: annotation: {error}") from None
    if len(arguments) < 2:  # noqa: PLR2004 - the parameters come after another one
        return None
    kind = list(arguments.values())[position].annotation
    is_struct = isinstance(kind, type) and issubclass(kind, msgspec.Struct)
    return kind if is_struct else None


def _not_finite(value: object) -> str:
    """Return the path of a number that is not finite, or an empty text."""
    inner: Mapping[Any, Any]
    if isinstance(value, Mapping):
        inner = value
    elif isinstance(value, list | tuple):
        inner = dict(enumerate(value))
    else:
        return ""
    for name, each in inner.items():
        if isinstance(each, float) and not math.isfinite(each):
            return str(name)
        if path := _not_finite(each):
            return f"{name}.{path}"
    return ""
