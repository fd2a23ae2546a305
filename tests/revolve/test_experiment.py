"""Experiments by name, by text, with changes, and back to text."""

import tomllib
from pathlib import Path
from typing import Any

import pytest

from revolve import Experiment, ExperimentError
from revolve.experiment import _toml, document_of
from schema.experiment.document import island_experiments
from schema.experiment.file import (
    experiment_from_text,
    experiment_text,
    read_experiment,
    shipped_experiments,
)


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


ISLANDS = """name = "a"
births = 60
[selection]
population = 12
[[islands]]
[islands.selection]
tournament_size = 4
[[islands]]
[islands.selection]
children = 5
[islands.simulation]
friction = 0.5
[[islands]]
[islands.arena]
population_limit = 20
[migration]
topology = "ring"
epoch = 20
"""


def test_replaced_keys_hold_on_islands_that_do_not_set_them() -> None:
    """Also after other ways of reading and writing the experiment."""
    changes: dict[str, Any] = {
        "selection": {"tournament_size": 2},
        "simulation": {"friction": 0.9},
        "environment": {"slope_deg": 3.0},
        "migration": {"migrants": 2},
    }
    wanted = Experiment.from_toml(ISLANDS, **changes)
    found = Experiment.from_toml(ISLANDS)
    for each in (found, Experiment.from_toml(found.to_toml())):
        one_by_one = each
        for key, value in changes.items():
            one_by_one = one_by_one.replace(**{key: value})
        assert each.replace(**changes) == one_by_one == wanted
    settings = wanted.settings["islands"]
    # The first island names the default itself, and keeps it.
    sizes = [each["selection"]["tournament_size"] for each in settings[:2]]
    assert sizes == [4, 2]
    assert settings[1]["simulation"]["friction"] == 0.5
    assert settings[1]["selection"]["population"] == 12
    assert found.settings["islands"][1]["selection"]["tournament_size"] == 4


def test_a_stored_experiment_is_complete_and_its_islands_follow_replaced_keys() -> None:
    stored = experiment_text(document_of(Experiment.from_toml(ISLANDS)))
    found = Experiment(experiment_from_text(stored))
    assert found == Experiment.from_toml(ISLANDS)
    changed = island_experiments(document_of(found.replace(selection={"window": 3})))
    assert [each.selection.window for each in changed] == [3, 3, 3]
    assert [each.selection.children for each in changed] == [15, 5, 15]
    assert [each.arena is not None for each in changed] == [False, False, True]


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
