"""Nodes of a YAML document, within limits.

Values and levels are counted while the document is parsed, so that one beyond the
limits is not parsed to its end. Aliases are refused: no document contains itself.
"""

from collections.abc import Iterator
from typing import cast

import yaml

from schema.limits import MOST_DEPTH, MOST_NODES

# The parser in C is 30 times as fast; not all builds of PyYAML have it.
_LOADER = getattr(yaml, "CSafeLoader", yaml.SafeLoader)


def root_node(text: str) -> yaml.Node | None:
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

    def document(self) -> yaml.Node | None:
        """Return the root node."""
        root: yaml.Node | None = None
        documents = 0
        for event in self._events:
            if isinstance(event, yaml.DocumentStartEvent):
                documents += 1
                if documents > 1:
                    raise _refusal("expected one document, got another", event)
                root = self._node(next(self._events), 1)
        return root

    def _node(self, event: yaml.Event, depth: int) -> yaml.Node:
        """Return the node that begins with an event."""
        self._count += 1
        if self._count > MOST_NODES:
            raise _refusal(f"must have <= {MOST_NODES} values, got more", event)
        if depth > MOST_DEPTH:
            raise _refusal(f"must have <= {MOST_DEPTH} levels, got more", event)
        if isinstance(event, yaml.AliasEvent):
            raise _refusal("aliases are not allowed", event)
        if isinstance(event, yaml.ScalarEvent):
            return yaml.ScalarNode("", event.value, _mark(event))
        items = []
        while not isinstance(inner := next(self._events), yaml.CollectionEndEvent):
            items.append(self._node(inner, depth + 1))
        if isinstance(event, yaml.SequenceStartEvent):
            return yaml.SequenceNode("", items, _mark(event))
        pairs = list(zip(items[::2], items[1::2], strict=True))
        return yaml.MappingNode("", pairs, _mark(event))


def _mark(event: yaml.Event) -> yaml.error.Mark | None:
    # The types know only the marks of the parser in Python.
    return cast("yaml.error.Mark | None", event.start_mark)


def _refusal(problem: str, event: yaml.Event) -> yaml.YAMLError:
    return yaml.composer.ComposerError(None, None, problem, _mark(event))
