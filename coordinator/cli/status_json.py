"""Progress of runs as a JSON document; docs/machines.md describes its keys."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from msgspec import to_builtins

from schema.wire.status import RunStatus, Status

VERSION = 1
"""Of the document; it changes when a key changes its meaning or is removed."""


@dataclass(frozen=True, slots=True)
class Source:
    """A status, and the coordinator that reported it or the folder that shows it."""

    status: Status
    coordinator: str | None = None
    folder: str | None = None


def status_json(sources: Sequence[Source]) -> str:
    """Return the document of all sources."""
    document = {
        "version": VERSION,
        "coordinators": [_coordinator(source) for source in sources],
    }
    return json.dumps(document, indent=2, allow_nan=False)


def _coordinator(source: Source) -> dict[str, Any]:
    status = source.status
    return {
        "name": source.coordinator,
        "folder": source.folder,
        "births": status.births,
        "wanted": status.wanted,
        "left_s": status.left_s,
        **to_builtins(status),
        "runs": [_run(run) for run in status.runs],
    }


def _run(run: RunStatus) -> dict[str, Any]:
    return {
        **to_builtins(run),
        "births": run.births,
        "wanted": run.wanted,
        "left_s": run.left_s,
    }
