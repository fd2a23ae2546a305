"""Experiments by name, by text, with changes, and back to text."""

import tomllib
from pathlib import Path

import pytest

from revolve import Experiment, ExperimentError
from revolve.experiment import _toml, document_of
from schema.experiment.file import read_experiment, shipped_experiments


@pytest.mark.parametrize("name", shipped_experiments())
def test_toml_of_a_shipped_experiment_gives_the_same_one(name: str) -> None:
    found = Experiment.read(name)
    assert document_of(found) == read_experiment(name) == document_of(name)
    assert Experiment.from_toml(found.to_toml()) == found
    assert hash(Experiment.from_toml(found.to_toml())) == hash(found)


def test_changes_of_sections_keep_their_other_keys(tmp_path: Path) -> None:
    file = tmp_path / "mine.toml"
    file.write_text('name = "mine"\n[selection]\npopulation = 7\nchildren = 3\n')
    found = Experiment.read(file, births=40, selection={"children": 5})
    assert (found.name, found.births) == ("mine", 40)
    assert found.settings["selection"]["population"] == 7
    assert found.settings["selection"]["children"] == 5
    again = found.replace(births=50, simulation={"friction": 0.5})
    assert (again.births, again.settings["simulation"]["friction"]) == (50, 0.5)
    assert again.settings["selection"] == found.settings["selection"]
    assert found.births == 40


def test_any_text_and_number_survives_in_toml() -> None:
    tree = {
        "a b": 'q "b" \\ \x7f \t \n é 🤖',
        "n": [1e-300, 1e22, -0.5, True, 3],
        "t": {},
    }
    assert tomllib.loads(f"value = {_toml(tree)}") == {"value": tree}


@pytest.mark.parametrize(
    ("changes", "expected"),
    [
        ({"birth": 3}, "birth: no such key; did you mean 'births'"),
        ({"births": 0}, "births"),
        ({"selection": {"childern": 1}}, "selection.childern: no such key"),
    ],
)
def test_wrong_keys_and_values_raise_one_line(
    changes: dict[str, object], expected: str
) -> None:
    with pytest.raises(ExperimentError) as raised:
        Experiment.read("scenario1", **changes)
    assert expected in str(raised.value)
    assert "\n" not in str(raised.value)


def test_unknown_experiment_names_the_nearest() -> None:
    with pytest.raises(ExperimentError, match="did you mean 'scenario1'"):
        Experiment.read("scenaro1")
