"""Digests of settings do not change when sections get new keys."""

from msgspec import json
from msgspec.structs import replace

from schema.experiment.document import Fitness, Measures
from schema.experiment.file import read_experiment
from schema.experiment.section import stable_json
from schema.experiment.settings import arena_settings_of

SETTINGS = arena_settings_of(read_experiment("scenario3"))


def test_later_keys_are_left_out_while_they_have_their_default() -> None:
    found = json.decode(stable_json(SETTINGS))
    assert list(found) == [
        "space", "simulation", "fitness", "arena", "environment", "origin"
    ]  # fmt: skip
    assert list(found["fitness"]) == [
        "function", "path_weight", "straight_weight", "limit"
    ]  # fmt: skip
    whole = json.decode(json.encode(SETTINGS))
    assert found["arena"] == whole["arena"]
    later = ("start_deg", "mass_factor", "torque_factor")
    assert found["simulation"].keys() == whole["simulation"].keys() - {*later}
    assert found["simulation"].items() <= whole["simulation"].items()


def test_later_keys_with_another_value_count() -> None:
    measured = replace(SETTINGS, measures=Measures(names=("turning",)))
    judged = replace(SETTINGS, fitness=Fitness(parameters={"a": 1}))
    assert len({stable_json(each) for each in (SETTINGS, measured, judged)}) == 3
