"""Markdown tables of the fields of msgspec Structs, for the generated pages.

Types and limits come from annotations, meanings and units from docstrings.
"""

import inspect
import json
import re
from collections.abc import Callable, Iterator
from sys import float_info
from typing import Any

import msgspec.inspect as kinds
from msgspec import NODEFAULT, Struct

from schema.limits import MOST_COUNT

_UNIT = re.compile(r"\[([^\],]+)\]")
_PLAIN = {
    kinds.AnyType: "any value",
    kinds.BoolType: "true or false",
    kinds.BytesType: "bytes",
    kinds.DictType: "table",
    kinds.FloatType: "number",
    kinds.IntType: "whole number",
    kinds.StrType: "text",
}
_MOST = (MOST_COUNT, float_info.max)
_SIGNS = {"ge": ">=", "gt": ">", "le": "<=", "lt": "<"}


def rows(
    struct: type[Struct], name_of: Callable[[type], str], *, with_defaults: bool = True
) -> Iterator[str]:
    """Yield the lines of a table of a Struct's fields.

    Args:
        struct: its class.
        name_of: returns what a cell says for a field that is another Struct.
        with_defaults: add a column of defaults.

    Raises:
        ValueError: the docstring says nothing about a field.
    """
    meanings = attributes(struct)
    default = ("default |", "---|") if with_defaults else ("", "")
    yield f"| name | type | {default[0]} unit | meaning |"
    yield f"|---|---|{default[1]}---|---|"
    for field in kinds.type_info(struct).fields:  # type: ignore[attr-defined]
        meaning = meanings.get(field.name, "")
        if not meaning:
            raise ValueError(f"{struct.__name__}.{field.name}: has no description")
        cells = [f"`{field.encode_name}`", shown_type(field.type, name_of)]
        cells += [_default(field)] if with_defaults else []
        measured = unit(field.name, field.type, meaning)
        cells += [measured, meaning.replace(f" [{measured}]", "").removesuffix(".")]
        yield f"| {' | '.join(cell.replace('|', chr(92) + '|') for cell in cells)} |"
    yield ""


def linked(text: str, up: str = "") -> str:
    """Return a text in which names of pages, docs/NAME.md, are links.

    Args:
        text: of a docstring.
        up: path from the folder of the page that shows it to docs/, with its slash.
    """
    return re.sub(r"\bdocs/(\w+)\.md\b", rf"[\1]({up}\1.md)", text)


def introduction(found: object) -> str:
    """Return the text of a docstring before its list of attributes, as Markdown."""
    text, _, rest = _docstring(found).partition("\nAttributes:\n")
    source = re.search(r"^Source: .*", rest, re.MULTILINE | re.DOTALL)
    return f"{text.strip()}\n\n{source[0] if source else ''}".strip()


def attributes(found: type) -> dict[str, str]:
    """Return the meanings of the attributes in the docstrings of a class, by name."""
    meanings: dict[str, str] = {}
    for kind in reversed(found.__mro__):
        if "\nAttributes:\n" in _docstring(kind):
            meanings |= _own_attributes(kind)
    return meanings


def _own_attributes(found: type) -> dict[str, str]:
    block = _docstring(found).partition("\nAttributes:\n")[2]
    block = re.split(r"\n(?=\S)", block)[0]
    meanings: dict[str, str] = {}
    for entry in re.split(r"\n(?= {4}\S)", block):
        names, _, meaning = " ".join(entry.split()).partition(": ")
        for name in names.split(", "):
            meanings[name] = meaning
    return meanings


def _docstring(found: object) -> str:
    return (inspect.getdoc(found) or "").replace("``", "`")


def shown_type(kind: kinds.Type, name_of: Callable[[type], str]) -> str:
    """Return a type and its limits in words."""
    match kind:
        case kinds.LiteralType():
            return ", ".join(f"`{json.dumps(value)}`" for value in kind.values)
        case kinds.UnionType():
            inner = [each for each in kind.types if each != kinds.NoneType()]
            return " or ".join(shown_type(each, name_of) for each in inner)
        case kinds.VarTupleType():
            return f"list of {shown_type(kind.item_type, name_of)}{_limits(kind)}"
        case kinds.TupleType():
            each = dict.fromkeys(shown_type(e, name_of) for e in kind.item_types)
            return f"list of {len(kind.item_types)} ({', '.join(each)})"
        case kinds.StructType() | kinds.NamedTupleType():
            return name_of(kind.cls)
    return _PLAIN[type(kind)] + _limits(kind)


def _limits(kind: kinds.Type) -> str:
    """Return the limits of a type; the greatest numbers are left out."""
    signs = [
        f"{sign} {value if isinstance(value, int) else format(value, 'g')}"
        for key, sign in _SIGNS.items()
        if (value := getattr(kind, key, None)) is not None and abs(value) not in _MOST
    ]
    counted = {kinds.StrType: "characters", kinds.BytesType: "bytes"}
    what = counted.get(type(kind), "items")
    lengths = [
        f", at {key} {value} {what}"
        for key, value in (
            ("least", getattr(kind, "min_length", None)),
            ("most", getattr(kind, "max_length", None)),
        )
        if value
    ]
    return (f" {', '.join(signs)}" if signs else "") + "".join(lengths)


def _default(field: kinds.Field) -> str:
    """Return a default as TOML has it."""
    value: Any = field.default
    if field.default_factory is not NODEFAULT:
        value = field.default_factory()
    if value is NODEFAULT:
        return "required" if field.required else "not given"
    if value is None:
        return "not given"
    if value == b"":
        return "empty"
    if isinstance(value, Struct):
        return "its defaults"
    if isinstance(value, tuple) and value and isinstance(value[0], str):
        return ", ".join(f"`{json.dumps(each)}`" for each in value)
    return f"`{json.dumps(value)}`"


def unit(name: str, kind: kinds.Type, meaning: str) -> str:
    """Return the unit of a field; 1 of a number without one, empty of no number."""
    if name.endswith("_steps"):
        return "steps"
    if not _has_float(kind):
        return ""
    found = _UNIT.search(meaning)
    return found[1] if found else "1"


def _has_float(kind: kinds.Type) -> bool:
    inner = (
        *getattr(kind, "types", ()),
        *getattr(kind, "item_types", ()),
        *filter(None, [getattr(kind, "item_type", None)]),
    )
    return isinstance(kind, kinds.FloatType) or any(map(_has_float, inner))
