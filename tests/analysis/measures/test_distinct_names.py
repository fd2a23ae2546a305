"""Experiments that have one name and other settings."""

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import pytest

from analysis.figures.style import colours, in_order, label, two_line_label
from analysis.measures.distinct_names import with_distinct_names
from analysis.measures.load import IslandSettings, Run
from schema.experiment.document import Experiment, Islands, Selection
from schema.experiment.file import experiment_text, read_experiment

SCENARIO = json.loads(experiment_text(read_experiment("scenario1")))

ALL_TYPES = json.dumps(SCENARIO["space"]["part_types"])
MANY = (
    "generation.parts_mean: 1.0 instead of 12.0, generation.parts_sd: 1.0 instead of "
    "5.0, generation.max_tries: 1 instead of 100, and 2 more"
)


def changed(**sections: Any) -> dict[str, Any]:  # noqa: ANN401 - of JSON
    """Return scenario 1 with some keys of its sections, or whole keys, changed."""
    return {
        **SCENARIO,
        **{
            name: {**SCENARIO[name], **value}
            if isinstance(SCENARIO[name], dict) and value
            else value
            for name, value in sections.items()
        },
    }


def runs(*documents: Mapping[str, Any], name: str = "scenario1") -> list[Run]:
    settings = (IslandSettings(60, is_online=False, records_touches=False),)
    return [
        Run(Path(f"{number}"), name, 0, number, "finished", json.dumps(each), settings)
        for number, each in enumerate(documents)
    ]


def told(*documents: Mapping[str, Any]) -> list[tuple[str, str]]:
    return [
        (run.experiment, run.differs) for run in with_distinct_names(runs(*documents))
    ]


def test_equal_settings_stay_one_experiment() -> None:
    assert told(SCENARIO, SCENARIO) == [("scenario1", "")] * 2


def test_births_are_no_setting() -> None:
    experiment = Experiment("e", islands=(Islands(births=20), Islands(births=30)))
    more = Experiment("e", islands=(Islands(births=50), Islands()))
    both = [json.loads(experiment_text(each)) for each in (experiment, more)]
    assert told(SCENARIO, changed(births=99)) == [("scenario1", "")] * 2
    assert told(*both) == [("scenario1", "")] * 2


def test_most_runs_keep_the_name_and_the_others_say_what_is_different() -> None:
    other = changed(selection={"population": 30, "parents": "random"})
    differs = (
        "selection.population: 30 instead of 15, "
        'selection.parents: "random" instead of "tournament"'
    )
    second, plain = ("scenario1~2", differs), ("scenario1", "")
    found = told(other, SCENARIO, SCENARIO, other, SCENARIO)
    assert found == [second, plain, plain, second, plain]


def test_of_as_many_the_first_keeps_the_name_and_each_kind_is_one_experiment() -> None:
    names = [
        name
        for name, _ in told(
            changed(simulation={"friction": 0.5}),
            SCENARIO,
            changed(simulation={"friction": 0.7}),
        )
    ]
    assert names == ["scenario1", "scenario1~2", "scenario1~3"]


@pytest.mark.parametrize(
    ("document", "differs"),
    [
        (changed(arena={}), "arena: settings instead of none"),
        (
            changed(islands=[{"count": 2}]),
            "islands.0: settings instead of none",
        ),
        (
            changed(space={"part_types": ["schema.parts:CORE"]}),
            f'space.part_types: ["schema.parts:CORE"] instead of {ALL_TYPES}',
        ),
        (
            changed(
                generation={"parts_mean": 1.0, "parts_sd": 1.0, "max_tries": 1},
                variation={"body_epsilon": 0.5, "brain_epsilon": 0.5},
            ),
            MANY,
        ),
    ],
)
def test_what_is_different_is_told(document: dict[str, Any], differs: str) -> None:
    assert told(SCENARIO, document) == [("scenario1", ""), ("scenario1~2", differs)]


def test_an_older_document_has_today_s_defaults_where_it_knows_nothing() -> None:
    older = {key: value for key, value in SCENARIO.items() if key != "environment"}
    older["simulation"] = {**SCENARIO["simulation"]}
    del older["simulation"]["sensor_noise"]
    assert told(SCENARIO, older) == [("scenario1", "")] * 2


def test_documents_that_are_not_ours_are_compared_as_they_stand() -> None:
    strange = {"births": 3, "fitness": "fast", "islands": [{"births": 4, "a": 1}]}
    assert told(strange, {**strange, "births": 5}) == [("scenario1", "")] * 2
    assert told(strange, {**strange, "fitness": "slow"})[1] == (
        "scenario1~2",
        'fitness: "slow" instead of "fast"',
    )
    further = {**strange, "islands": [{"births": 4, "a": 2}]}
    assert told(strange, further)[1][1] == "islands.0.a: 2 instead of 1"


def test_names_are_told_apart_each_for_itself() -> None:
    some = [*runs(SCENARIO), *runs(changed(births=5), name="mine")]
    some += runs(json.loads(experiment_text(Experiment("mine"))), name="mine")
    assert [run.experiment for run in with_distinct_names(some)] == [
        "scenario1",
        "mine",
        "mine",
    ]
    islands = Experiment("mine", selection=Selection(population=4))
    some += runs(json.loads(experiment_text(islands)), name="mine")
    assert with_distinct_names(some)[-1].experiment == "mine~2"


def test_a_name_that_an_experiment_has_is_given_to_no_other() -> None:
    taken = runs(SCENARIO, name="scenario1~2")
    others = [changed(simulation={"friction": each}) for each in (0.5, 0.7)]
    names = [
        run.experiment for run in with_distinct_names(runs(SCENARIO, *others) + taken)
    ]
    assert names == ["scenario1", "scenario1~3", "scenario1~4", "scenario1~2"]


def test_figures_say_which_is_meant() -> None:
    assert label("scenario1~2") == "scenario 1 ~2"
    assert two_line_label("no-selection~2") == "no selection\n~2"
    names = ["scenario1~2", "scenario1", "scenario2"]
    assert in_order(names) == ["scenario1", "scenario2", "scenario1~2"]
    assert len(set(colours(names).values())) == 3
