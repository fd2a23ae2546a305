"""Tables of an experiment as Structs: sections, and parameters of plug-ins."""

import inspect
import math
import re
from collections.abc import Callable, Iterator, Mapping
from typing import Any, Literal, TypeVar, get_args, get_origin

import msgspec

from schema.errors import ExperimentError, cut, expectation, nearest, shown

T = TypeVar("T", bound=msgspec.Struct)

_UNKNOWN = re.compile("Object contains unknown field `(.*)`")


def read_parameters(
    table: Mapping[str, Any], kind: type[T], where: str, separator: str = "."
) -> T:
    """Return a table of a user's document as a Struct, whose defaults complete it.

    Messages begin with ``where``, the table's key, as ``fitness.parameters``, or the
    path of the document, and the separator before a key.

    Raises:
        ExperimentError: an unknown key (the nearest is named) or a missing one, a value
            of another type or outside its range, or a number that is not finite.
    """
    known = list(keys_of(kind))
    # A plug-in's own Struct may ignore unknown keys.
    for key in table:
        if key not in known:
            raise ExperimentError(f"{where}{separator}{_no_such_key(key, '', known)}")
    for path, number in _numbers(table):
        if not math.isfinite(number):
            at = f"{where}{separator}{path}"
            raise ExperimentError(f"{at}: must be finite, got {number}")
    try:
        return msgspec.convert(dict(table), kind)
    except msgspec.ValidationError as error:
        message, _, path = str(error).partition(" - at `$.")
        key = path.rstrip("`")
        why = _explain(message, key, *_at(table, kind, key))
        raise ExperimentError(f"{where}{separator if key else ': '}{why}") from None


def parameters_type(
    function: Callable[..., Any], where: str, position: int = 1
) -> type[msgspec.Struct] | None:
    """Return the Struct with which the argument for parameters is annotated, or None.

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


def known_keys(value: Any, kind: Any) -> Any:  # noqa: ANN401 - any tree of plain values
    """Return a value of a stored document without keys that its sections lack."""
    if isinstance(value, list):
        return [known_keys(each, kind) for each in value]
    kinds = keys_of(kind)
    if not kinds or not isinstance(value, dict):
        return value
    return {
        key: known_keys(each, kinds[key]) for key, each in value.items() if key in kinds
    }


def section_of(kind: Any) -> type[msgspec.Struct] | None:  # noqa: ANN401 - any annotation
    """Return the section type of an annotation; None if it is a plain value."""
    if isinstance(kind, type) and issubclass(kind, msgspec.Struct):
        return kind
    inner = () if get_origin(kind) is dict else get_args(kind)
    return next(filter(None, map(section_of, inner)), None)


def keys_of(kind: Any) -> dict[str, Any]:  # noqa: ANN401 - any annotation
    """Return the annotations of a section's keys; none if it is no section."""
    section = section_of(kind)
    fields = msgspec.structs.fields(section) if section else ()
    return {field.encode_name: field.type for field in fields}


def _numbers(value: object, path: str = "") -> Iterator[tuple[str, float]]:
    """Yield path and value of each float in a tree of plain values."""
    if isinstance(value, float):
        yield path, value
    elif isinstance(value, Mapping):
        for key, each in value.items():
            yield from _numbers(each, f"{path}.{cut(key)}" if path else cut(key))
    elif isinstance(value, list | tuple):
        for at, each in enumerate(value):
            yield from _numbers(each, f"{path}[{at}]")


def _at(table: Mapping[str, Any], kind: Any, key: str) -> tuple[Any, Any]:  # noqa: ANN401
    """Return the value and the annotation at a dotted key, as msgspec names it."""
    value: Any = table
    for name in key.split(".") if key else ():
        word, *places = name.replace("]", "").split("[")
        value = value.get(word) if isinstance(value, Mapping) else None
        kind = keys_of(kind).get(word)
        for place in places:
            value = value[int(place)] if isinstance(value, list) else None
    return value, kind


def _explain(message: str, key: str, value: Any, kind: Any) -> str:  # noqa: ANN401
    """Return a message of msgspec as ``key: expected, got value``."""
    if unknown := _UNKNOWN.fullmatch(message):
        return _no_such_key(unknown[1], f"{key}.", list(keys_of(kind)))
    wanted = expectation(message).partition(", got ")[0]
    if not key:
        return wanted
    if isinstance(value, Mapping) and wanted.startswith("must be a list"):
        return f"{key}: must be [[{key}]], got [{key}]"
    choices = get_args(kind) if get_origin(kind) is Literal else ()
    if choices:
        wanted = f"must be one of {', '.join(map(repr, choices))}"
    if wanted == "must be a list":
        # Also of ``tuple[float, float] | None``.
        pairs = [each for each in (kind, *get_args(kind)) if get_origin(each) is tuple]
        if pairs and Ellipsis not in (words := get_args(pairs[0])):
            wanted += f" of length {len(words)}"
    return f"{key}: {wanted}, got {shown(value)}{nearest(value, choices)}"


def _no_such_key(name: str, prefix: str, known: list[str]) -> str:
    allowed = ", ".join(known) or "none"
    if "parameters" in known:
        allowed += f"; those of a plug-in are in [{prefix}parameters]"
    near = nearest(name, known)
    return f"{prefix}{cut(name)}: no such key{near}; allowed: {allowed}"
