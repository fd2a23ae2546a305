"""Loading of plug-ins by name."""

from pathlib import Path

import pytest

from schema.errors import ExperimentError, UnknownPlugin
from schema.experiment.plugin import load
from schema.parts import BUILT_IN


def test_built_ins_are_loaded_like_plug_ins() -> None:
    assert load("schema.parts:HINGE", "space.part_types") is BUILT_IN["Hinge"]


@pytest.mark.parametrize("path", ["", "schema.parts", ":HINGE", "schema.parts:", "a b"])
def test_name_that_is_not_a_path_is_refused(path: str) -> None:
    with pytest.raises(UnknownPlugin, match="key: must be 'module:attribute', got"):
        load(path, "key")


def test_missing_module_is_refused() -> None:
    with pytest.raises(UnknownPlugin, match=r"key: 'schema\.nothing:X': No module"):
        load("schema.nothing:X", "key")


@pytest.mark.parametrize(
    "module", ["", ".", "..parts", ".parts", "schema..parts", "a\0b"]
)
def test_impossible_module_name_is_refused(module: str) -> None:
    with pytest.raises(UnknownPlugin, match="key: "):
        load(f"{module}:X", "key")


def test_error_names_the_nearest_attribute() -> None:
    with pytest.raises(UnknownPlugin, match=r"did you mean 'schema\.parts:HINGE'"):
        load("schema.parts:HINGEE", "key")


def test_error_without_a_near_attribute() -> None:
    with pytest.raises(UnknownPlugin, match=r"has no 'zzzzzz'$"):
        load("schema.parts:zzzzzz", "key")


@pytest.mark.parametrize("text", ["1 +", "1 / 0"])
def test_module_that_raises_on_import_is_an_experiment_error(
    text: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    name = f"broken_{len(text)}"
    (tmp_path / f"{name}.py").write_text(text)
    monkeypatch.syspath_prepend(tmp_path)
    with pytest.raises(ExperimentError, match=f"key: '{name}:X': "):
        load(f"{name}:X", "key")
