"""YAML mappings with line numbers for error messages.

A scalar is converted to the type that the caller requests: ``1e-5`` is read as a
number where a number is expected, although it is a text in YAML 1.1.
"""

import math
import re
from collections.abc import Callable, Collection, Mapping
from itertools import islice
from types import MappingProxyType
from typing import NoReturn, TypeVar

import yaml

from schema.errors import InvalidRobot, nearest, one_line, shown
from schema.formats.yaml_compose import (
    MappingNode,
    Node,
    ScalarNode,
    SequenceNode,
    root_node,
)
from schema.limits import MOST_TEXT_BYTES, printable

T = TypeVar("T", int, float)

_SLOT = re.compile("0|[1-9][0-9]{0,3}")
_NULL = ("", "~", "null", "Null", "NULL")
# Most allowed words that a message lists.
_MOST_WORDS = 40


class Table:
    """Mapping in a document.

    Attributes:
        line: number of its first line, from 1.
        keys: as written, in their order.
    """

    def __init__(self, node: Node | None, path: str, file: str) -> None:
        """Read the keys of a node.

        Raises:
            InvalidRobot: not a mapping, a key that is not a scalar, a duplicate key.
        """
        self._path = path
        self._stem = f"{path}." if path else ""
        self._file = file
        self.line = _line(node)
        self._values: dict[str, Node] = {}
        self._key_lines: dict[str, int] = {}
        if not isinstance(node, MappingNode):
            self._fail(path, f"must be a mapping, got {_shown(node)}", self.line)
        for key, value in node.value:
            if not isinstance(key, ScalarNode):
                self._fail(path, "a key must be a word or a number", _line(key))
            if key.value in self._values:
                self._fail(self._at(key.value), "is given twice", _line(key))
            self._values[key.value] = value
            self._key_lines[key.value] = _line(key)

    def rename(self, name: str) -> None:
        """Name the mapping in messages by its id in place of its path."""
        self._path, self._stem = name, f"{name}: "

    @property
    def keys(self) -> tuple[str, ...]:
        """Return the keys as written, in their order."""
        return tuple(self._values)

    def lines(self, name: str) -> dict[str, int]:
        """Return the lines of the mapping (``name``) and its keys (``name.key``)."""
        keys = {f"{name}.{key}": line for key, line in self._key_lines.items()}
        return {name: self.line, **keys}

    def has(self, key: str) -> bool:
        """Return whether the mapping has a key."""
        return key in self._values

    def is_mapping(self, key: str) -> bool:
        """Return whether the value of a key is a mapping."""
        return isinstance(self._values.get(key), MappingNode)

    def is_null(self, key: str) -> bool:
        """Return whether a key is missing or its value is YAML's null."""
        node = self._values.get(key)
        return node is None or (isinstance(node, ScalarNode) and node.value in _NULL)

    def is_empty(self, key: str) -> bool:
        """Return whether a key is missing or has no value."""
        node = self._values.get(key)
        return node is None or not node.value

    def refuse(self, key: str, message: str) -> NoReturn:
        """Raise ``InvalidRobot`` about a key."""
        self._fail(self._at(key), message, self._key_lines.get(key, self.line))

    def refuse_type(self, allowed: Collection[str], hint: str = "") -> NoReturn:
        """Raise ``InvalidRobot`` about a type that is none of some types.

        Args:
            allowed: the types; one of a similar name is named.
            hint: end of the message.
        """
        word = self.text("type")
        line = self._key_lines["type"]
        problem = f"{self._at('type')} {shown(word)} is not supported"
        end = f"{nearest(word, allowed)}{hint}"
        self._fail("", f"{problem}: {_one_of(allowed)}{end}", line)

    def refuse_others(self, *allowed: str) -> None:
        """Raise unless all keys are allowed; the message names the nearest key.

        Raises:
            InvalidRobot: a key that is not allowed.
        """
        for key in self._values:
            if key not in allowed:
                words = ", ".join(allowed)
                self.refuse(
                    key, f"no such key{nearest(key, allowed)}; allowed: {words}"
                )

    def table(self, key: str) -> "Table":
        """Return the mapping of a key.

        Raises:
            InvalidRobot: no such key, or not a mapping.
        """
        return Table(self._node(key), self._at(key), self._file)

    def tables(self, key: str) -> list["Table"]:
        """Return the list of mappings of a key; empty if the key is missing.

        Raises:
            InvalidRobot: not a list of mappings.
        """
        if key not in self._values:
            return []
        node = self._node(key)
        if not isinstance(node, SequenceNode):
            self.refuse(key, f"must be a list, got {_shown(node)}")
        return [
            Table(item, f"{self._at(key)}[{index}]", self._file)
            for index, item in enumerate(node.value)
        ]

    def text(self, key: str, default: str | None = None) -> str:
        """Return the text of a key.

        Raises:
            InvalidRobot: no such key and no default, or not a text.
        """
        if default is not None and key not in self._values:
            return default
        node = self._node(key)
        if not isinstance(node, ScalarNode) or not node.value:
            self.refuse(key, f"must be a word, got {_shown(node)}")
        return node.value

    def word(
        self,
        key: str,
        allowed: Collection[str],
        also: Mapping[str, str] = MappingProxyType({}),
    ) -> str:
        """Return the text of a key, one of some words.

        Args:
            key: of the mapping.
            allowed: the words.
            also: synonyms, as a mapping to words of ``allowed``.

        Raises:
            InvalidRobot: no such key, or another word; the message names the nearest.
        """
        word = also.get(self.text(key), self.text(key))
        if word not in allowed:
            near = nearest(word, allowed)
            self.refuse(key, f"{_one_of(allowed)}, got {shown(word)}{near}")
        return word

    def integer(self, key: str, default: int | None = None) -> int:
        """Return the whole number of a key.

        Raises:
            InvalidRobot: no such key and no default, or not a whole number.
        """
        return self._number(key, default, int, "a whole number")

    def number(self, key: str, default: float | None = None) -> float:
        """Return the finite number of a key.

        Raises:
            InvalidRobot: no such key and no default, or not a finite number.
        """
        return self._number(key, default, float, "a finite number")

    def _number(
        self, key: str, default: T | None, parse: Callable[[str], T], what: str
    ) -> T:
        if default is not None and key not in self._values:
            return default
        try:
            value = parse(self.text(key))
        except ValueError:
            value = None
        # Not of an integer, which may be too large for a float.
        is_infinite = isinstance(value, float) and not math.isfinite(value)
        if value is None or is_infinite:
            self.refuse(key, f"must be {what}, got {_shown(self._node(key))}")
        return value

    def key_as_slot(self, key: str) -> int:
        """Return a key as a slot number.

        Raises:
            InvalidRobot: not a plain number such as 0 or 12.
        """
        if not _SLOT.fullmatch(key):
            self.refuse(key, "must be a slot number: 0, 1, ...")
        return int(key)

    def _at(self, key: str) -> str:
        return f"{self._stem}{printable(key)}"

    def _node(self, key: str) -> Node:
        if key not in self._values:
            self._fail(self._at(key), "is missing", self.line)
        return self._values[key]

    def _fail(self, path: str, message: str, line: int) -> NoReturn:
        field = f"{path}: " if path else ""
        raise InvalidRobot(f"{self._file}:{line}: {field}{message}")


def compose(text: str, file: str) -> Table:
    """Return the top-level mapping of a document.

    Args:
        text: the document.
        file: its name, for messages.

    Raises:
        InvalidRobot: not YAML, not a mapping, or beyond a limit (``schema.limits``).
    """
    if len(text) > MOST_TEXT_BYTES:
        raise InvalidRobot(
            f"{file}: must have <= {MOST_TEXT_BYTES} characters, got {len(text)}"
        )
    try:
        node = root_node(text)
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = "" if mark is None else f":{mark.line + 1}"
        raise InvalidRobot(f"{file}{line}: not valid YAML: {error.problem}") from None
    except yaml.YAMLError as error:
        raise InvalidRobot(f"{file}: not valid YAML: {one_line(error)}") from None
    return Table(node, "", file)


def _one_of(allowed: Collection[str]) -> str:
    first = ", ".join(map(printable, islice(allowed, _MOST_WORDS)))
    more = ", ..." if len(allowed) > _MOST_WORDS else ""
    return f"must be one of {first}{more}"


def _line(node: Node | None) -> int:
    return 1 if node is None else node.line


def _shown(node: Node | None) -> str:
    """Return a short description of a node for a message."""
    if isinstance(node, ScalarNode):
        return repr(node.value[:40]) if node.value else "nothing"
    if node is None:
        return "nothing"
    return "a list" if isinstance(node, SequenceNode) else "a mapping"
