"""Tests of names and units of fitness functions."""

import pyarrow as pa

from analysis.measures.fitness_functions import (
    UNITS,
    axis_text,
    by_function,
    functions_of,
)
from schema.experiment.settings import FITNESS


def runs(**functions: str | None) -> pa.Table:
    rows = [
        {"experiment": name, "fitness_function": text}
        for name, text in functions.items()
    ]
    columns = {"experiment": pa.string(), "fitness_function": pa.string()}
    return pa.Table.from_pylist(rows, pa.schema(columns))


def test_digests_of_sources_are_shown_only_where_they_tell_apart() -> None:
    found = functions_of(
        runs(
            a="goals:far (source 1a)",
            b="goals:far (source 2b)",
            c="goals:up (limit = 2.0, source 2b)",
            d="goals:up (limit = 2.0, source 2b)",
            e=None,
        )
    )
    assert found == {
        "a": "goals:far (source 1a)",
        "b": "goals:far (source 2b)",
        "c": "goals:up (limit = 2.0)",
        "d": "goals:up (limit = 2.0)",
        "e": "",
    }
    assert by_function(found)["goals:up (limit = 2.0)"] == ["c", "d"]


def test_functions_of_the_toolkit_have_units() -> None:
    assert UNITS.keys() == FITNESS.keys()
    assert axis_text("turning (wander_weight = 1.0)") == "fitness [rad/s]"
    assert axis_text("goals:far") == axis_text("turning and locomotion") == "fitness"
