"""Nodes of a YAML document, within limits.

Values and levels are counted while the document is parsed, so that one beyond the
limits is not parsed to its end. Aliases are refused: no document contains itself.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TypeAlias, cast

import yaml

from schema.limits import MOST_DEPTH, MOST_NODES

# The parser in C is 30 times as fast; not all builds of PyYAML have it.
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


@dataclass(slots=True)
class ScalarNode:
    """Text of a scalar, and its line from 1."""

    value: str
    line: int


@dataclass(slots=True)
class SequenceNode:
    """Items of a list, and its line from 1."""

    value: list["Node"]
    line: int


@dataclass(slots=True)
class MappingNode:
    """Keys and values of a mapping, and its line from 1."""

    value: list[tuple["Node", "Node"]]
    line: int


# Smaller than the nodes of PyYAML, which keep a mark of two positions each.
Node: TypeAlias = ScalarNode | SequenceNode | MappingNode


def root_node(text: str) -> Node | None:
    """Return the root node of a document, without tags; None if it is empty.

    Raises:
        yaml.YAMLError: not YAML, several documents, an alias, too many values or
            levels.
    """
    return _Composer(yaml.parse(text, Loader=_LOADER)).document()


class _Composer:
    """Builder of the nodes of one document from its events."""

    def __init__(self, events: Iterator[yaml.Event]) -> None:
        self._events = events
        self._count = 0

    def document(self) -> Node | None:
        """Return the root node."""
        root: Node | None = None
        documents = 0
        for event in self._events:
            if isinstance(event, yaml.DocumentStartEvent):
                documents += 1
                if documents > 1:
                    raise _refusal("expected one document, got another", event)
                root = self._node(next(self._events), 1)
        return root

    def _node(self, event: yaml.Event, depth: int) -> Node:
        """Return the node that begins with an event."""
        self._count += 1
        if self._count > MOST_NODES:
            raise _refusal(f"must have <= {MOST_NODES} values, got more", event)
        if depth > MOST_DEPTH:
            raise _refusal(f"must have <= {MOST_DEPTH} levels, got more", event)
        line = _mark(event).line + 1
        if isinstance(event, yaml.ScalarEvent):
            return ScalarNode(event.value, line)
        if isinstance(event, yaml.AliasEvent):
            raise _refusal("aliases are not allowed", event)
        items = []
        while not isinstance(inner := next(self._events), yaml.CollectionEndEvent):
            items.append(self._node(inner, depth + 1))
        if isinstance(event, yaml.SequenceStartEvent):
            return SequenceNode(items, line)
        return MappingNode(list(zip(items[::2], items[1::2], strict=True)), line)


def _mark(event: yaml.Event) -> yaml.error.Mark:
    # The types know only the marks of the parser in Python, and None.
    return cast("yaml.error.Mark", event.start_mark)


def _refusal(problem: str, event: yaml.Event) -> yaml.YAMLError:
    return yaml.composer.ComposerError(None, None, problem, _mark(event))
