"""Tests of experiments of one name, and of names and units of fitness functions."""

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import pyarrow as pa
import pytest

from analysis.measures.distinct_names import with_distinct_names
from analysis.measures.fitness_functions import (
    UNITS,
    axis_text,
    by_function,
    functions_of,
)
from analysis.measures.load import LoadedRun
from schema.experiment.document import Experiment, Islands, SelectionSection
from schema.experiment.file import (
    experiment_from_text,
    experiment_text,
    read_experiment,
)
from schema.experiment.settings import FITNESS

Document = Mapping[str, Any]


def document_of(experiment: Experiment) -> Any:  # noqa: ANN401 - of JSON
    return json.loads(experiment_text(experiment))


SCENARIO = document_of(read_experiment("scenario1"))
ALL_TYPES = json.dumps(SCENARIO["space"]["part_types"])


def changed(**sections: Any) -> dict[str, Any]:  # noqa: ANN401 - of JSON
    """Return scenario 1 with some keys of its sections, or whole keys, changed."""
    merged = {
        name: {**SCENARIO[name], **value}
        if isinstance(SCENARIO[name], dict) and value
        else value
        for name, value in sections.items()
    }
    return {**SCENARIO, **merged}


def runs(*documents: Document, name: str = "scenario1") -> list[LoadedRun]:
    texts = enumerate(map(json.dumps, documents))
    return [
        LoadedRun(Path(), name, 0, number, "finished", text, experiment_from_text(text))
        for number, text in texts
    ]


def named(some: list[LoadedRun]) -> list[tuple[str, str]]:
    return [(run.experiment, run.differs) for run in with_distinct_names(some)]


OLDER = {key: value for key, value in SCENARIO.items() if key != "environment"} | {
    "simulation": {key: value for key, value in SCENARIO["simulation"].items()
                   if key != "sensor_noise"}
}  # fmt: skip


@pytest.mark.parametrize(
    ("first", "second", "differs"),
    [
        (SCENARIO, SCENARIO, ""),
        (SCENARIO, changed(births=99), ""),
        (document_of(Experiment("e", islands=(Islands(births=20), Islands(births=3)))),
         document_of(Experiment("e", islands=(Islands(births=50), Islands()))), ""),
        # Missing keys of an older document have current defaults.
        (SCENARIO, OLDER, ""),
        (SCENARIO, changed(arena={}), "arena: settings instead of none"),
        (SCENARIO, changed(islands=[{"count": 2}]),
         "islands.0: settings instead of none"),
        (SCENARIO, changed(space={"part_types": ["schema.parts:CORE"]}),
         f'space.part_types: ["schema.parts:CORE"] instead of {ALL_TYPES}'),
        (SCENARIO, changed(generation={"parts_mean": 1.0, "max_tries": 1},
                           variation={"body_epsilon": 0.5}),
         ("generation.parts_mean: 1.0 instead of 12.0, generation.max_tries: 1 "
          "instead of 100, variation.body_epsilon: 0.5 instead of 0.05")),
    ],
)  # fmt: skip
def test_differences_are_listed(
    first: Document, second: Document, differs: str
) -> None:
    other = ("scenario1~2", differs) if differs else ("scenario1", "")
    assert named(runs(first, second)) == [("scenario1", ""), other]


def test_most_runs_keep_the_name_or_the_first_of_equally_many() -> None:
    other = changed(selection={"population": 30, "parents": "random"})
    differs = (
        "selection.population: 30 instead of 15, "
        'selection.parents: "random" instead of "tournament"'
    )
    second, plain = ("scenario1~2", differs), ("scenario1", "")
    found = named(runs(other, SCENARIO, SCENARIO, other, SCENARIO))
    assert found == [second, plain, plain, second, plain]
    frictions = [changed(simulation={"friction": each}) for each in (0.5, 0.7)]
    found = named(runs(frictions[0], SCENARIO, frictions[1]))
    assert [name for name, _ in found] == ["scenario1", "scenario1~2", "scenario1~3"]
    # A taken name is not used again.
    taken = runs(SCENARIO, name="scenario1~2")
    found = named(runs(SCENARIO, *frictions) + taken)
    assert [name for name, _ in found] == [
        "scenario1", "scenario1~3", "scenario1~4", "scenario1~2",
    ]  # fmt: skip
    # Each name is numbered separately.
    fewer = document_of(Experiment("mine", selection=SelectionSection(population=4)))
    mine = (changed(births=5), document_of(Experiment("mine")), fewer)
    found = named([*runs(SCENARIO), *runs(*mine, name="mine")])
    assert [name for name, _ in found] == ["scenario1", "mine", "mine", "mine~2"]


def test_an_edited_plug_in_is_another_setting() -> None:
    some = zip(runs(SCENARIO, SCENARIO, SCENARIO), ("1a", "1a", "2b"), strict=True)
    found = named([replace(run, plugins={"goals": digest}) for run, digest in some])
    differs = (
        "source of plug-in goals (plugins/goals.py in the run folders): digest 2b "
        "instead of 1a"
    )
    assert found == [("scenario1", "")] * 2 + [("scenario1~2", differs)]


def test_other_experiments_are_compared_with_the_one_most_like_them() -> None:
    other = changed(simulation={"friction": 0.5})
    third = changed(selection={"population": 30})
    some = [*runs(SCENARIO), *runs(other), *runs(third, third, other, name="mine")]
    against = "(compared with scenario1)"
    first, second, *mine, last = named(some)
    assert first == ("scenario1", "")
    assert mine == [("mine", f"selection.population: 30 instead of 15 {against}")] * 2
    assert (second[0], last[0]) == ("scenario1~2", "mine~2")
    for _, differs in (second, last):
        assert "simulation.friction: 0.5 instead of" in differs
        assert against not in differs
    tuned = changed(selection={"population": 30, "tournament_size": 8})
    more = changed(selection={"population": 30, "tournament_size": 8, "children": 9})
    some = [run for at, one in enumerate((SCENARIO, tuned, more))
            for run in runs(one, name=f"e{at}")]  # fmt: skip
    (_, nothing), (_, of_tuned), (_, of_more) = named(some)
    assert nothing == ""
    assert of_tuned.endswith(" (compared with e0)")
    assert of_more == "selection.children: 9 instead of 15 (compared with e1)"


def test_settings_of_a_sweep_are_swept() -> None:
    points = [
        changed(
            selection={"population": population},
            sweep={"settings": {}, "chosen": {"selection.population": population}},
        )
        for population in (10, 20)
    ]
    differs = "selection.population: swept instead of 15 (compared with scenario1)"
    found = named([*runs(SCENARIO), *runs(*points, name="s")])
    assert found == [("scenario1", ""), ("s", differs), ("s", differs)]


def test_digests_of_sources_are_shown_only_where_they_tell_apart() -> None:
    texts = {
        "a": "goals:far (source 1a)",
        "b": "goals:far (source 2b)",
        "c": "goals:up (limit = 2.0, source 2b)",
        "d": "goals:up (limit = 2.0, source 2b)",
        "e": None,
    }
    columns = {"experiment": [*texts], "fitness_function": [*texts.values()]}
    found = functions_of(pa.table(columns))
    short = "goals:up (limit = 2.0)"
    assert found == texts | {"c": short, "d": short, "e": ""}
    assert by_function(found)[short] == ["c", "d"]


def test_functions_of_the_toolkit_have_units() -> None:
    assert UNITS.keys() == FITNESS.keys()
    assert axis_text("turning (wander_weight = 1.0)") == "fitness [rad/s]"
    assert axis_text("goals:far") == axis_text("turning and locomotion") == "fitness"
