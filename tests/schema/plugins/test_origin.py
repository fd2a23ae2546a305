"""Where plug-ins come from: modules that settings name, files and lines."""

import json
import sys
from collections.abc import Callable
from functools import partial

import pytest

from schema.errors import ExperimentError
from schema.plugins import permission
from schema.plugins.load import load_object
from schema.plugins.origin import (
    naming_plugin,
    where_defined,
    where_named,
    where_raised,
)
from schema.plugins.source import modules_named

SOURCE = '''"""Plug-ins of a lab."""

from functools import lru_cache


def judge(trace, parameters):
    return 1.0


@lru_cache
def cached(trace):
    return 1.0


class Rule:
    pass


RULE = Rule()
TYPED: Rule = Rule()


def fails():
    return 1 / 0
'''


@pytest.fixture
def lab(own_module: Callable[[str], str]) -> str:
    """Return the name of a plug-in module of its own."""
    return own_module(SOURCE)


@pytest.mark.parametrize(
    ("attribute", "line"),
    [("judge", 6), ("cached", 10), ("Rule", 15), ("RULE", 19), ("TYPED", 20)],
)
def test_file_and_line_of_a_module(lab: str, attribute: str, line: int) -> None:
    plugin: object = load_object(f"{lab}:{attribute}", "key", {})
    place = f"{lab}.py:{line}"
    assert where_named(sys.modules[lab], attribute) == place
    if callable(plugin):
        assert where_defined(plugin) == place


def test_object_without_a_name_is_found_by_its_class(lab: str) -> None:
    assert where_named(permission.import_allowed(lab), "no_such") == f"{lab}.py"
    rule: type = load_object(f"{lab}:Rule", "key", {})
    assert where_defined(rule()) == f"{lab}.py:15"


def test_partial_function_is_found_by_the_function_inside(lab: str) -> None:
    judge: Callable[..., float] = load_object(f"{lab}:judge", "key", {})
    assert where_defined(partial(judge, parameters=3)) == f"{lab}.py:6"


def test_name_stands_for_what_has_no_file() -> None:
    assert where_defined(len) == "builtins:len"
    assert where_defined(3) == "builtins:int"


def test_line_that_raised(lab: str) -> None:
    judge: Callable[..., float] = load_object(f"{lab}:judge", "key", {})
    with pytest.raises(TypeError) as caught:
        judge()
    # The call failed, not the code.
    assert where_raised(caught.value, f"{lab}.py") == ""
    with pytest.raises(ZeroDivisionError) as caught_inside:
        load_object(f"{lab}:fails", "key", dict[str, Callable[[], None]]())()
    assert where_raised(caught_inside.value, f"{lab}.py") == f"{lab}.py:24"
    with pytest.raises(ExperimentError) as told, naming_plugin("key", judge):
        raise ValueError("two\nlines")
    assert str(told.value) == (
        f"key: {where_defined(judge)}: raised ValueError: two lines"
    )
    with pytest.raises(ExperimentError) as told, naming_plugin("key", judge):
        raise caught_inside.value
    assert str(told.value).endswith(
        f"raised ZeroDivisionError: division by zero ({lab}.py:24)"
    )


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
