"""Tests of experiments of the same name with different settings."""

import json
from collections.abc import Mapping
from dataclasses import replace
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
    "5.0, generation.max_tries: 1 instead of 100, variation.body_epsilon: 0.5 instead "
    "of 0.05, variation.brain_epsilon: 0.5 instead of 0.1"
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


def named(*documents: Mapping[str, Any]) -> list[tuple[str, str]]:
    return [
        (run.experiment, run.differs) for run in with_distinct_names(runs(*documents))
    ]


def test_equal_settings_stay_one_experiment() -> None:
    assert named(SCENARIO, SCENARIO) == [("scenario1", "")] * 2


def test_different_births_are_the_same_experiment() -> None:
    experiment = Experiment("e", islands=(Islands(births=20), Islands(births=30)))
    more = Experiment("e", islands=(Islands(births=50), Islands()))
    both = [json.loads(experiment_text(each)) for each in (experiment, more)]
    assert named(SCENARIO, changed(births=99)) == [("scenario1", "")] * 2
    assert named(*both) == [("scenario1", "")] * 2


def test_most_runs_keep_the_name_and_others_list_their_differences() -> None:
    other = changed(selection={"population": 30, "parents": "random"})
    differs = (
        "selection.population: 30 instead of 15, "
        'selection.parents: "random" instead of "tournament"'
    )
    second, plain = ("scenario1~2", differs), ("scenario1", "")
    found = named(other, SCENARIO, SCENARIO, other, SCENARIO)
    assert found == [second, plain, plain, second, plain]


def test_the_first_of_equally_many_settings_keeps_the_name() -> None:
    names = [
        name
        for name, _ in named(
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
def test_differences_are_listed(document: dict[str, Any], differs: str) -> None:
    assert named(SCENARIO, document) == [("scenario1", ""), ("scenario1~2", differs)]


def test_missing_keys_of_an_older_document_have_current_defaults() -> None:
    older = {key: value for key, value in SCENARIO.items() if key != "environment"}
    older["simulation"] = {**SCENARIO["simulation"]}
    del older["simulation"]["sensor_noise"]
    assert named(SCENARIO, older) == [("scenario1", "")] * 2


def test_invalid_documents_are_compared_unchanged() -> None:
    strange = {"births": 3, "fitness": "fast", "islands": [{"births": 4, "a": 1}]}
    assert named(strange, {**strange, "births": 5}) == [("scenario1", "")] * 2
    assert named(strange, {**strange, "fitness": "slow"})[1] == (
        "scenario1~2",
        'fitness: "slow" instead of "fast"',
    )
    further = {**strange, "islands": [{"births": 4, "a": 2}]}
    assert named(strange, further)[1][1] == "islands.0.a: 2 instead of 1"


def test_an_edited_plug_in_is_another_setting() -> None:
    some = runs(SCENARIO, SCENARIO, SCENARIO)
    digests = ({"goals": "1a"}, {"goals": "1a"}, {"goals": "2b"})
    found = with_distinct_names(
        [replace(run, plugins=each) for run, each in zip(some, digests, strict=True)]
    )
    differs = (
        "source of plug-in goals (plugins/goals.py in the run folders): digest 2b "
        "instead of 1a"
    )
    assert [(run.experiment, run.differs) for run in found] == [
        ("scenario1", ""),
        ("scenario1", ""),
        ("scenario1~2", differs),
    ]


def test_other_experiments_are_compared_with_the_first() -> None:
    other = changed(simulation={"friction": 0.5})
    third = changed(selection={"population": 30})
    some = [*runs(SCENARIO), *runs(other), *runs(third, third, other, name="mine")]
    against = "(compared with scenario1)"
    friction = "simulation.friction: 0.5 instead of"
    found = [(run.experiment, run.differs) for run in with_distinct_names(some)]
    assert found[0] == ("scenario1", "")
    assert (
        found[2:4]
        == [("mine", f"selection.population: 30 instead of 15 {against}")] * 2
    )
    assert [name for name, _ in found] == [
        "scenario1",
        "scenario1~2",
        *["mine"] * 2,
        "mine~2",
    ]
    for _, differs in (found[1], found[4]):
        assert friction in differs
        assert against not in differs


def test_an_experiment_is_compared_with_the_one_that_is_most_like_it() -> None:
    tuned = changed(selection={"population": 30, "tournament_size": 8})
    more = changed(selection={"population": 30, "tournament_size": 8, "children": 9})
    some = [run for at, one in enumerate((SCENARIO, tuned, more))
            for run in runs(one, name=f"e{at}")]  # fmt: skip
    found = [
        run.differs.partition(" (compared")[::2] for run in with_distinct_names(some)
    ]
    assert [against for _, against in found] == ["", " with e0)", " with e1)"]
    assert found[2][0] == "selection.children: 9 instead of 15"


def test_settings_of_a_sweep_are_swept() -> None:
    points = [
        changed(
            selection={"population": population},
            sweep={"chosen": {"selection.population": population}},
        )
        for population in (10, 20)
    ]
    some = [*runs(SCENARIO), *runs(*points, name="s")]
    assert [run.differs for run in with_distinct_names(some)] == [
        "",
        *["selection.population: swept instead of 15 (compared with scenario1)"] * 2,
    ]


def test_each_name_is_numbered_separately() -> None:
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


def test_a_taken_name_is_not_used_again() -> None:
    taken = runs(SCENARIO, name="scenario1~2")
    others = [changed(simulation={"friction": each}) for each in (0.5, 0.7)]
    names = [
        run.experiment for run in with_distinct_names(runs(SCENARIO, *others) + taken)
    ]
    assert names == ["scenario1", "scenario1~3", "scenario1~4", "scenario1~2"]


def test_figures_label_renamed_experiments() -> None:
    assert label("scenario1~2") == "scenario 1 ~2"
    assert two_line_label("no-selection~2") == "no selection\n~2"
    names = ["scenario1~2", "scenario1", "scenario2"]
    assert in_order(names) == ["scenario1", "scenario2", "scenario1~2"]
    assert len(set(colours(names).values())) == 3
