"""Modules of plug-ins that settings name."""

import json

import pytest

from schema.plugins.source import modules_named

PLUGINS = {
    "space": {"part_types": ["schema.parts:CORE", "my_parts.arms:ELBOW"]},
    "fitness": {"function": "gaits:frugal", "parameters": {}},
    "selection": {"parents": "crowding:small_parents"},
    "islands": [{"fitness": {"function": "jumps:high"}}],
    "measures": {"names": ["lab:height"], "parameters": {"lab:height": {}}},
    "sweep": {"settings": {"brain.type": ["waves:Wave", "network"]}},
}


def modules(document: object) -> list[str]:
    return modules_named(json.dumps(document).encode())


def test_modules_of_plugins_are_named_once_and_sorted() -> None:
    expected = ["crowding", "gaits", "jumps", "lab", "my_parts", "waves"]
    assert modules(PLUGINS) == expected
    assert modules([PLUGINS, PLUGINS]) == expected
    assert modules({"function": "worker.fitness:thesis"}) == []


@pytest.mark.parametrize(
    "document",
    [
        {"fitness": {"function": "locomotion", "parameters": {"gait": "trot:slow"}}},
        {"brain": {"parameters": {"waves": [{"of": "leg:left"}, "leg:right"]}}},
        {"selection": {"parents_parameters": {"order": "up:down"}}},
        {"islands": [{"learning": {"parameters": {"start": "at:rest"}}}]},
        {"sweep": {"settings": {"fitness.parameters.gait": ["trot:slow"]}}},
        {"sweep": {"chosen": {"selection.survivors_parameters.order": "up:down"}}},
        {"fitness": {"function": "a:b c"}},
        {"name": "numpy:one", "births": 5},
    ],
)
def test_other_texts_name_no_module(document: object) -> None:
    assert modules(document) == []
