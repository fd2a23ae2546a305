"""Documents in YAML or JSON as mappings, with line numbers for error messages.

A scalar is converted to the type that the caller requests: ``1e-5`` is read as a
number where a number is expected, although it is a text in YAML 1.1. Values and levels
are counted while a document is parsed, so that one beyond the limits is not parsed to
its end. Aliases are refused: no document contains itself.
"""

import math
import re
from collections.abc import Callable, Collection, Iterator
from itertools import islice
from typing import NamedTuple, NoReturn, TypeVar, cast

import yaml

from schema.errors import InvalidRobot, check_most, nearest, one_line, shown
from schema.limits import MOST_DEPTH, MOST_NODES, MOST_TEXT_BYTES, printable

T = TypeVar("T", int, float)

# The parser in C is 30 times as fast; not all builds of PyYAML have it.
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
_SLOT = re.compile("0|[1-9][0-9]{0,3}")
_NULL = ("", "~", "null", "Null", "NULL")
# Most allowed words that a message lists.
_MOST_WORDS = 40


class DocumentNode(NamedTuple):
    """Value in a document, and its line from 1.

    Smaller than the nodes of PyYAML, which keep a mark of two positions each.

    Attributes:
        value: text of a scalar, items of a list, or the values of a mapping by key,
            each with the line of its key.
        line: on which it begins.
    """

    value: "str | list[DocumentNode] | dict[str, tuple[DocumentNode, int]]"
    line: int


class _Composer:
    """Builder of the nodes of one document from its events."""

    def __init__(self, events: Iterator[yaml.Event]) -> None:
        self._events = events
        self._count = 0

    def document(self) -> DocumentNode | None:
        """Return the root node; None if the document is empty."""
        root: DocumentNode | None = None
        documents = 0
        for event in self._events:
            if isinstance(event, yaml.DocumentStartEvent):
                documents += 1
                if documents > 1:
                    raise _refusal("expected one document, got another", event)
                root = self._node(next(self._events), 1)
        return root

    def _node(self, event: yaml.Event, depth: int) -> DocumentNode:
        self._count += 1
        if self._count > MOST_NODES:
            raise _refusal(f"must have <= {MOST_NODES} values, got more", event)
        if depth > MOST_DEPTH:
            raise _refusal(f"must have <= {MOST_DEPTH} levels, got more", event)
        if isinstance(event, yaml.AliasEvent):
            raise _refusal("aliases are not allowed", event)
        line = _mark(event).line + 1
        if isinstance(event, yaml.ScalarEvent):
            return DocumentNode(event.value, line)
        if isinstance(event, yaml.SequenceStartEvent):
            return DocumentNode(
                [self._node(item, depth + 1) for item in self._items()], line
            )
        values: dict[str, tuple[DocumentNode, int]] = {}
        for first in self._items():
            key, key_line = self._node(first, depth + 1)
            if not isinstance(key, str):
                raise _refusal("a key must be a word or a number", first)
            if key in values:
                raise _refusal(f"key {shown(key)} is given twice", first)
            values[key] = self._node(next(self._events), depth + 1), key_line
        return DocumentNode(values, line)

    def _items(self) -> Iterator[yaml.Event]:
        """Yield the first event of each item of a list or mapping."""
        while not isinstance(event := next(self._events), yaml.CollectionEndEvent):
            yield event


def _mark(event: yaml.Event) -> yaml.error.Mark:
    # The types know only the marks of the parser in Python, and None.
    return cast("yaml.error.Mark", event.start_mark)


def _refusal(problem: str, event: yaml.Event) -> yaml.YAMLError:
    return yaml.composer.ComposerError(None, None, problem, _mark(event))


class Table:
    """Mapping in a document, whose first line, from 1, is ``line``.

    Its methods raise ``InvalidRobot``, with file, line and path: for a missing key
    without a default, or a value of another kind.
    """

    def __init__(self, node: DocumentNode | None, path: str, file: str) -> None:
        self._path = path
        self._stem = f"{path}." if path else ""
        self._file = file
        self.line = 1 if node is None else node.line
        if node is None or not isinstance(node.value, dict):
            self._fail(path, f"must be a mapping, got {_shown(node)}", self.line)
        self._values = node.value

    def rename(self, name: str) -> None:
        """Name the mapping in messages by its id in place of its path."""
        self._path, self._stem = name, f"{name}: "

    @property
    def keys(self) -> tuple[str, ...]:
        """Return the keys as written, in their order."""
        return tuple(self._values)

    def lines(self, name: str) -> dict[str, int]:
        """Return the lines of the mapping (``name``) and its keys (``name.key``)."""
        keys = {f"{name}.{key}": line for key, (_, line) in self._values.items()}
        return {name: self.line, **keys}

    def has(self, key: str) -> bool:
        """Return whether the mapping has a key."""
        return key in self._values

    def is_mapping(self, key: str) -> bool:
        """Return whether the value of a key is a mapping."""
        return self.has(key) and isinstance(self._values[key][0].value, dict)

    def is_null(self, key: str) -> bool:
        """Return whether a key is missing or its value is YAML's null."""
        return not self.has(key) or self._values[key][0].value in _NULL

    def is_empty(self, key: str) -> bool:
        """Return whether a key is missing or has no value."""
        return not self.has(key) or not self._values[key][0].value

    def refuse(self, key: str, message: str) -> NoReturn:
        """Raise ``InvalidRobot`` about a key."""
        line = self._values[key][1] if self.has(key) else self.line
        self._fail(self._at(key), message, line)

    def refuse_others(self, *allowed: str) -> None:
        """Raise unless all keys are allowed; the message names the nearest key."""
        for key in self._values:
            if key not in allowed:
                words = ", ".join(allowed)
                self.refuse(
                    key, f"no such key{nearest(key, allowed)}; allowed: {words}"
                )

    def table(self, key: str) -> "Table":
        """Return the mapping of a key."""
        return Table(self._node(key), self._at(key), self._file)

    def tables(self, key: str) -> list["Table"]:
        """Return the list of mappings of a key; empty if the key is missing."""
        if not self.has(key):
            return []
        items = self._node(key).value
        if not isinstance(items, list):
            self.refuse(key, f"must be a list, got {_shown(self._node(key))}")
        return [
            Table(item, f"{self._at(key)}[{index}]", self._file)
            for index, item in enumerate(items)
        ]

    def text(self, key: str, default: str | None = None) -> str:
        """Return the text of a key."""
        if default is not None and not self.has(key):
            return default
        value = self._node(key).value
        if not isinstance(value, str) or not value:
            self.refuse(key, f"must be a word, got {_shown(self._node(key))}")
        return value

    def word(self, key: str, allowed: Collection[str], hint: str = "") -> str:
        """Return the text of a key, one of some words; a hint ends the message."""
        word = self.text(key)
        if word not in allowed:
            first = ", ".join(map(printable, islice(allowed, _MOST_WORDS)))
            more = ", ..." if len(allowed) > _MOST_WORDS else ""
            near = f"{nearest(word, allowed)}{hint}"
            self.refuse(key, f"must be one of {first}{more}, got {shown(word)}{near}")
        return word

    def integer(self, key: str, default: int | None = None) -> int:
        """Return the whole number of a key."""
        return self._number(key, default, int, "a whole number")

    def number(self, key: str, default: float | None = None) -> float:
        """Return the finite number of a key."""
        return self._number(key, default, float, "a finite number")

    def _number(
        self, key: str, default: T | None, parse: Callable[[str], T], what: str
    ) -> T:
        if default is not None and not self.has(key):
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
        """Return a key as a slot number."""
        if not _SLOT.fullmatch(key):
            self.refuse(key, "must be a slot number: 0, 1, ...")
        return int(key)

    def _at(self, key: str) -> str:
        return f"{self._stem}{printable(key)}"

    def _node(self, key: str) -> DocumentNode:
        if not self.has(key):
            self._fail(self._at(key), "is missing", self.line)
        return self._values[key][0]

    def _fail(self, path: str, message: str, line: int) -> NoReturn:
        field = f"{path}: " if path else ""
        raise InvalidRobot(f"{self._file}:{line}: {field}{message}")


def compose(text: str, file: str, language: str = "YAML") -> Table:
    """Return the top-level mapping of a document.

    JSON is read as YAML.

    Raises:
        InvalidRobot: not of the language, not a mapping, or beyond a limit.
    """
    check_most(len(text), MOST_TEXT_BYTES, "characters", file, InvalidRobot)
    try:
        node = _Composer(yaml.parse(text, Loader=_LOADER)).document()
    except yaml.MarkedYAMLError as error:
        mark = error.problem_mark or error.context_mark
        line = "" if mark is None else f":{mark.line + 1}"
        problem = f"not valid {language}: {error.problem}"
        raise InvalidRobot(f"{file}{line}: {problem}") from None
    except yaml.YAMLError as error:
        problem = f"not valid {language}: {one_line(error)}"
        raise InvalidRobot(f"{file}: {problem}") from None
    return Table(node, "", file)


def _shown(node: DocumentNode | None) -> str:
    value = node.value if node is not None else ""
    if isinstance(value, str):
        return repr(value[:40]) if value else "nothing"
    return "a list" if isinstance(value, list) else "a mapping"
