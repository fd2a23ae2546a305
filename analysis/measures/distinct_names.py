"""Distinct names for experiments with different settings, and how these differ.

A mean over runs with different settings would describe neither experiment. The source
of a plug-in counts as a setting: an edited fitness function is another one. The number
of planned births is not compared: experiments are compared at births that all runs
reach.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import count
from typing import Any

from msgspec import to_builtins

from analysis.measures.load import LoadedRun

MARK = "~"
"""Separator of a name and a number that makes it distinct."""
_NOT_SETTINGS = frozenset({"name", "births"})
_SWEPT = "swept"
"""Value of a setting that a sweep chooses, as runs of a sweep are one experiment."""


def with_distinct_names(runs: Sequence[LoadedRun]) -> list[LoadedRun]:
    """Return runs in their order, with distinct names for different settings.

    The settings that most runs of a name have (the first of equally many) keep the
    name. The next settings become ``name~2``, or the next free number, and ``differs``
    lists how they differ. For an experiment of another name than the first one,
    ``differs`` lists how it differs from the earlier one that is most like it, and
    names that one.
    """
    groups: dict[str, dict[str, list[LoadedRun]]] = {}
    for run in runs:
        both = (_settings(run), dict(run.plugins))
        text = json.dumps(both, sort_keys=True)
        groups.setdefault(run.experiment, {}).setdefault(text, []).append(run)
    renamed: dict[int, LoadedRun] = {}
    earlier: list[LoadedRun] = []
    for name, by_settings in groups.items():
        first, *others = sorted(by_settings.values(), key=len, reverse=True)
        lists = [(_compared(first[0], other), other) for other in earlier]
        found, nearest = min(lists, key=lambda one: len(one[0]), default=([], first[0]))
        if found:
            differs = f"{', '.join(found)} (compared with {nearest.experiment})"
            for run in first:
                renamed[id(run)] = replace(run, differs=differs)
        earlier.append(first[0])
        free = (each for n in count(2) if (each := f"{name}{MARK}{n}") not in groups)
        for experiment, group in zip(free, others, strict=False):
            differs = ", ".join(_compared(group[0], first[0]))
            for run in group:
                renamed[id(run)] = replace(run, experiment=experiment, differs=differs)
    return [renamed.get(id(run), run) for run in runs]


def _settings(run: LoadedRun) -> dict[str, Any]:
    """Return a run's settings; those of a sweep that it is a point of are marked."""
    entries: dict[str, Any] = to_builtins(run.settings)
    for key in (entries.get("sweep") or {}).pop("chosen", None) or {}:
        _mark_swept(entries, key.split("."))
    return _without(entries)


def _mark_swept(section: dict[str, Any], words: Sequence[str]) -> None:
    for word in words[:-1]:
        section = section.get(word) or {}
    if words[-1] in section:
        section[words[-1]] = _SWEPT


def _without(entries: Mapping[str, Any]) -> dict[str, Any]:
    """Return a section without the keys that are no settings, and islands by index."""
    found = {key: value for key, value in entries.items() if key not in _NOT_SETTINGS}
    if "islands" in found:
        islands = enumerate(found["islands"])
        found["islands"] = {str(place): _without(each) for place, each in islands}
    return found


def _compared(mine: LoadedRun, other: LoadedRun) -> list[str]:
    # A plug-in that only one of them has is named by another setting.
    found = [
        f"source of plug-in {name} (plugins/{name}.py in the run folders): digest "
        f"{mine.plugins[name]} instead of {digest}"
        for name, digest in other.plugins.items()
        if mine.plugins.get(name, digest) != digest
    ]
    settings = _settings(mine), _settings(other)
    if not all(each.get("sweep") for each in settings):
        # The settings that only one of them sweeps are listed.
        for each in settings:
            each.pop("sweep", None)
    return [*found, *_differences(*settings, "")]


def _differences(mine: object, other: object, where: str) -> Iterator[str]:
    if isinstance(mine, dict) and isinstance(other, dict):
        for key in dict.fromkeys((*other, *mine)):
            place = f"{where}.{key}" if where else key
            yield from _differences(mine.get(key), other.get(key), place)
    elif mine != other:
        yield f"{where}: {_text(mine)} instead of {_text(other)}"


def _text(value: object) -> str:
    if value is None:
        return "none"
    if value == _SWEPT:
        return _SWEPT
    return "settings" if isinstance(value, dict) else json.dumps(value)
