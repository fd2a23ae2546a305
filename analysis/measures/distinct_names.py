"""Tells apart experiments of one name whose settings differ.

Two experiments that bear one name are two, and a mean over both would be of neither.
How many births were planned makes no difference: what is compared is compared where
all have come to.
"""

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import replace
from itertools import count
from typing import Any

from analysis.measures.load import Run
from schema.errors import ExperimentError
from schema.experiment.file import experiment_from_text, experiment_text

MARK = "~"
"""Between a name and the number of those who also bear it."""
_NOT_SETTINGS = frozenset({"name", "births"})
_SAID = 3
"""Differences that are told one by one."""


def told_apart(runs: Sequence[Run]) -> list[Run]:
    """Return runs in their order, experiments of one name and other settings renamed.

    The settings that most runs of a name have (of several, those of the first run)
    keep it; the next become ``name~2``, or the next that no experiment has, and say
    in ``differs`` what sets them apart.

    Args:
        runs: of any experiments.
    """
    groups: dict[str, dict[str, list[Run]]] = {}
    for run in runs:
        text = json.dumps(_settings(run.document), sort_keys=True)
        groups.setdefault(run.experiment, {}).setdefault(text, []).append(run)
    renamed: dict[int, Run] = {}
    for name, by_settings in groups.items():
        first, *others = sorted(by_settings.values(), key=len, reverse=True)
        free = (each for n in count(2) if (each := f"{name}{MARK}{n}") not in groups)
        for experiment, group in zip(free, others, strict=False):
            differs = _told(group[0].document, first[0].document)
            for run in group:
                renamed[id(run)] = replace(run, experiment=experiment, differs=differs)
    return [renamed.get(id(run), run) for run in runs]


def _settings(document: str) -> dict[str, Any]:
    """Return a document's settings, those of an older one with today's defaults."""
    with suppress(ExperimentError):  # else it is compared as it stands
        document = experiment_text(experiment_from_text(document))
    entries: dict[str, Any] = json.loads(document)
    return _without(entries)


def _without(entries: Mapping[str, Any]) -> dict[str, Any]:
    """Return a section without what is no setting, and its islands by their place."""
    found = {key: value for key, value in entries.items() if key not in _NOT_SETTINGS}
    if "islands" in found:
        islands = enumerate(found["islands"])
        found["islands"] = {str(place): _without(each) for place, each in islands}
    return found


def _told(mine: str, others: str) -> str:
    """Return how an experiment differs from another of its name, in words."""
    found = list(_differences(_settings(mine), _settings(others), ""))
    more = [f"and {len(found) - _SAID} more"] if len(found) > _SAID else []
    return ", ".join(found[:_SAID] + more)


def _differences(mine: object, other: object, where: str) -> Iterator[str]:
    if isinstance(mine, dict) and isinstance(other, dict):
        for key in dict.fromkeys((*other, *mine)):
            place = f"{where}.{key}" if where else key
            yield from _differences(mine.get(key), other.get(key), place)
    elif mine != other:
        yield f"{where}: {_said(mine)} instead of {_said(other)}"


def _said(value: object) -> str:
    if value is None:
        return "none"
    return "settings" if isinstance(value, dict) else json.dumps(value)
