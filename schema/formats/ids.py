"""The user's own ids in messages about a robot."""

import re
from collections.abc import Sequence

from schema.errors import shown

_INDEXED = re.compile(r"(body\.parts|brain\.neurons|brain\.connections)\[(\d+)\](\.?)")
_WORDS = {"body.parts": "part", "brain.neurons": "neuron", "brain.connections": ""}


def with_ids(
    message: str,
    parts: Sequence[str],
    neurons: Sequence[str],
    connections: Sequence[tuple[str, str]],
) -> str:
    """Return a message of ``check_robot`` with ids in place of indices.

    ``body.parts[2].slot: ...`` becomes ``part 'leg': slot: ...``.
    """
    ids = {
        "body.parts": [shown(name) for name in parts],
        "brain.neurons": [shown(name) for name in neurons],
        "brain.connections": [
            f"connection {shown(source)} -> {shown(target)}"
            for source, target in connections
        ],
    }

    def named(found: re.Match[str]) -> str:
        kind, index, dot = found[1], int(found[2]), found[3]
        if index >= len(ids[kind]):
            return found[0]
        stem = f"{_WORDS[kind]} {ids[kind][index]}".strip()
        return f"{stem}: " if dot else stem

    return _INDEXED.sub(named, message)
