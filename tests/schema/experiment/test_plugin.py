"""Code named by data."""

from pathlib import Path

import pytest

from schema.errors import ExperimentError, UnknownPlugin
from schema.experiment.plugin import load
from schema.parts import BUILT_IN


def test_built_ins_go_the_same_way_as_a_users() -> None:
    assert load("schema.parts:HINGE", "space.part_types") is BUILT_IN["Hinge"]


@pytest.mark.parametrize("path", ["", "schema.parts", ":HINGE", "schema.parts:", "a b"])
def test_not_a_path(path: str) -> None:
    with pytest.raises(UnknownPlugin, match="key: must be 'module:attribute', got"):
        load(path, "key")


def test_no_such_module() -> None:
    with pytest.raises(UnknownPlugin, match=r"key: 'schema\.nothing:X': No module"):
        load("schema.nothing:X", "key")


@pytest.mark.parametrize(
    "module", ["", ".", "..parts", ".parts", "schema..parts", "a\0b"]
)
def test_no_module_can_be_called_that(module: str) -> None:
    with pytest.raises(UnknownPlugin, match="key: "):
        load(f"{module}:X", "key")


def test_nearest_name_is_told() -> None:
    with pytest.raises(UnknownPlugin, match=r"did you mean 'HINGE'"):
        load("schema.parts:HINGEE", "key")


def test_nothing_near() -> None:
    with pytest.raises(UnknownPlugin, match=r"has no 'zzzzzz'$"):
        load("schema.parts:zzzzzz", "key")


@pytest.mark.parametrize("text", ["1 +", "1 / 0"])
def test_a_module_that_breaks_is_the_users_fault(
    text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = f"broken_{len(text)}"
    (tmp_path / f"{name}.py").write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ExperimentError, match=f"key: '{name}:X': "):
        load(f"{name}:X", "key")
