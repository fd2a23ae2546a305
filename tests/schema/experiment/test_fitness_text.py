"""Tests of fitness functions as text."""

import json
from typing import Any

import pytest

from schema.experiment.document import Experiment, Fitness, Islands
from schema.experiment.file import experiment_from_text
from schema.experiment.fitness_keys import fitness_text

OWN: dict[str, Any] = {"function": "goals.fast:speed", "parameters": {"b": 2, "a": [1]}}


def stored(document: dict[str, Any]) -> Experiment:
    return experiment_from_text(json.dumps({"name": "e", **document}))


@pytest.mark.parametrize(
    ("document", "expected"),
    [
        ({}, "locomotion"),
        ({"fitness": {"function": "locomotion"}}, "locomotion"),
        ({"fitness": {"function": "worker.fitness:thesis"}}, "locomotion"),
        ({"fitness": {"function": "worker.tasks:turning"}}, "turning"),
        ({"fitness": {"limit": 2.0}}, "locomotion (limit = 2.0)"),
        ({"fitness": OWN}, "goals.fast:speed (a = [1], b = 2, source 1a)"),
        (
            {"fitness": OWN, "islands": [{}, {"fitness": {"limit": 2.0}}, {}]},
            "goals.fast:speed (a = [1], b = 2, source 1a) and locomotion (limit = 2.0)",
        ),
        ({"fitness": {"function": "other:f"}}, "other:f (source unknown)"),
    ],
)
def test_functions_by_hand(document: dict[str, Any], expected: str) -> None:
    assert fitness_text(stored(document), {"goals": "1a"}) == expected


def test_sources_may_be_left_out() -> None:
    assert fitness_text(stored({"fitness": OWN})) == "goals.fast:speed (a = [1], b = 2)"


def test_complete_documents_have_short_texts() -> None:
    both = (Islands(), Islands(fitness=Fitness(path_weight=0.0)))
    document = Experiment("e", islands=both)
    assert fitness_text(document) == "locomotion and locomotion (path_weight = 0.0)"
