"""What counts as a change of a user's module or object."""

from collections.abc import Callable
from types import ModuleType

import pytest

from schema.errors import ExperimentError
from schema.plugins.load import load_module
from schema.plugins.state import own_modules, unchanged

LAB = """
from collections import Counter, deque
from functools import cache, partial

import numpy as np
from msgspec import Struct


class Note(Struct):
    text: str = ""


class Slotted:
    __slots__ = ("inner",)


def counted(seen=[]):
    pass


def made(kept):
    return lambda: kept


@cache
def square(number):
    return number * number


TABLE, QUEUE, COUNTS, NAMES = np.zeros((2, 2)), deque([1]), Counter(), {1, 2}
MIXED = np.array([[1], None], dtype=object)
NOTE, SLOTTED, MADE = Note(), Slotted(), made([])
SLOTTED.inner = {"deep": [(1, [2])]}
RING = [NAMES]
RING.append(RING)
"""


@pytest.fixture
def lab(own_module: Callable[[str], str]) -> ModuleType:
    return load_module(own_module(LAB), "test")


@pytest.mark.parametrize(
    ("action", "changed"),
    [
        ("lab.TABLE[1, 1] = 2.0", "TABLE"),
        ("lab.QUEUE.append(2)", "QUEUE"),
        ("lab.COUNTS['a'] += 1", "COUNTS"),
        ("lab.NAMES.add(3)", "NAMES"),
        ("lab.MIXED[0].append(2)", "MIXED"),
        ("lab.NOTE.text = 'later'", "NOTE"),
        ("lab.SLOTTED.inner['deep'][0][1].append(3)", "SLOTTED"),
        ("lab.counted.__defaults__[0].append(1)", "counted"),
        ("lab.MADE.__closure__[0].cell_contents.append(1)", "MADE"),
        ("lab.RING.append(1)", "RING"),
        ("lab.Slotted.shared = 1", "Slotted"),
        ("lab.NEW = 1", "NEW"),
        ("del lab.NOTE", "NOTE"),
        ("lab.TABLE = lab.TABLE + 0.0", ""),
        ("lab.square(3)", ""),
        ("lab.NOTE = lab.Note()", ""),
        ("lab.NAMES.add(2)", ""),
    ],
)
def test_change_of_content_is_named(lab: ModuleType, action: str, changed: str) -> None:
    modules = own_modules()
    assert lab.__name__ in modules
    assert not {"numpy", "schema.parts", "random"} & {*modules}
    fault = ""
    try:
        with unchanged("stay", modules):
            exec(action, {"lab": lab})  # noqa: S102 - what a plug-in may do
    except ExperimentError as error:
        fault = str(error)
    expected = f"must stay, but changes {lab.__name__}.{changed}"
    assert fault == (expected if changed else "")
