"""Fitness functions of an experiment as text, which tells what is comparable."""

import json
from collections.abc import Iterator, Mapping
from typing import Any

from msgspec import to_builtins

from schema.experiment.document import Fitness
from schema.experiment.settings import FITNESS
from schema.plugins.permission import ROOMS

_SHORT = {path: name for name, path in FITNESS.items()}
_DEFAULTS: dict[str, Any] = to_builtins(Fitness())


def fitness_text(
    document: Mapping[str, Any], digests: Mapping[str, str] | None = None
) -> str:
    """Return the fitness functions of an experiment, with what changes their values.

    Fitness has the same meaning in two experiments if these texts are equal.

    Args:
        document: an experiment as JSON, perhaps of an earlier version.
        digests: of the sources of plug-ins, by module; None leaves sources out.

    Returns:
        For example ``locomotion``, ``locomotion (limit = 2.0)`` or ``goals:fast
        (source 6f1d2a)``; several functions of islands with ``and`` between. Keys with
        default values are left out.
    """
    sections = (
        each.get("fitness") or document.get("fitness") or {}
        for each in document.get("islands") or [{}]
    )
    return " and ".join(dict.fromkeys(_text(each, digests) for each in sections))


def _text(section: Mapping[str, Any], digests: Mapping[str, str] | None) -> str:
    known = {**_DEFAULTS, **section}
    function = str(known["function"])
    notes = list(_changed(known, _DEFAULTS))
    module = function.partition(":")[0].partition(".")[0]
    if digests is not None and ":" in function and module not in ROOMS:
        notes.append(f"source {digests.get(module, 'unknown')}")
    name = _SHORT.get(function, function)
    return f"{name} ({', '.join(notes)})" if notes else name


def _changed(entries: Mapping[str, Any], usual: Mapping[str, Any]) -> Iterator[str]:
    """Yield ``key = value`` for each key but the function whose value is not usual."""
    for key in sorted(entries):
        value = entries[key]
        if key == "parameters":
            yield from _changed(value, {})
        elif key != "function" and value != usual.get(key):
            yield f"{key} = {json.dumps(value, sort_keys=True)}"
