"""Measures and figures of arenas with rules of their own, by hand."""

import pyarrow as pa
import pytest

from analysis.figures import ecosystems as figures
from analysis.figures.catalogue import FIGURES
from analysis.figures.forms import NothingToDraw
from analysis.measures import ecosystems as measures
from analysis.measures.outputs import run_schema
from analysis.measures.run_tables import RunTables
from tests.analysis.drawn import layers
from tests.analysis.tables import births, run, table


def sample(birth: int, time_s: float, energy: float | None) -> dict[str, object]:
    stores = None if energy is None else {"energy": energy, "rests_until_s": 9.0}
    return {"birth": birth, "sim_time_s": time_s, "stores": stores}


def mating(parents: list[int], child: int | None) -> dict[str, object]:
    ids = [{"island": 0, "birth": number} for number in parents]
    return {"parents": ids, "birth": child, "sim_time_s": 7.0, "x": 0.5, "y": 0.0}


PAIR = [(0, 0), (0, 1)]
TABLES = RunTables(
    run(
        births=births(
            ((0, 0), []), ((0, 1), []), ((0, 2), PAIR), ((0, 3), [(0, 0), (0, 2)]),
            sim_time_s=[0.0, 1.0, 6.0, 12.0], x=[0.0, 1.0, 2.0, 3.0], y=[0.0] * 4,
        ),
        fitness=table("fitness", [
            sample(0, 5.0, 8.0), sample(1, 5.0, 4.0), sample(0, 10.0, 3.0),
            sample(2, 10.0, None), sample(2, 15.0, None),
        ]),
        deaths=table("deaths", [
            {"birth": 1, "sim_time_s": 9.0, "reason": "age"},
            {"birth": 0, "sim_time_s": 14.0, "reason": "no energy"},
            {"birth": 7, "birth_island": 1, "sim_time_s": 14.0, "reason": "age"},
        ]),
        matings=table("matings", [
            mating([0, 1], 2), mating([0, 2], 3), mating([0, 1], None), mating([0], 3),
        ]),
        patches=table("patches", [
            {"patch": 0, "x": 1.0, "radius_m": 0.5, "content": content}
            for content in (30.0, 10.0)
        ]),
    )
)  # fmt: skip


def test_measures_by_hand() -> None:
    courses = measures.life_courses(TABLES).to_pylist()
    names = ("sim_time_s", "living", "energy", "born")
    assert [tuple(row[name] for name in names) for row in courses] == [
        (5.0, 2, 6.0, 2), (10.0, 2, 3.0, 1), (15.0, 1, None, 1)
    ]  # fmt: skip
    lives = measures.lifespans(TABLES).to_pylist()
    assert [(row["birth"], row["age_s"], row["reason"]) for row in lives] == [
        (1, 8.0, "age"), (0, 14.0, "no energy")
    ]  # fmt: skip
    pairs = measures.couples(TABLES).to_pylist()
    # 0 and 1 share nothing; of 0, 1 and 2, the robots 0 and 2 share 0.
    assert [(row["birth"], row["second_x"], row["related"]) for row in pairs] == [
        (2, 1.0, 0.0), (3, 2.0, pytest.approx(1 / 3))
    ]  # fmt: skip
    assert measures.birth_places(TABLES)["children"].to_pylist() == [2, 1, 1, 0]
    assert measures.patch_means(TABLES)["content"].to_pylist() == [20.0]


NAMES = ("life_courses", "lifespans", "birth_places", "couples", "patch_means")


def named(name: str) -> pa.Table:
    made: pa.Table = getattr(measures, name)(TABLES).cast(run_schema(name))
    for column in ("experiment", "folder"):
        made = made.append_column(column, pa.repeat("a", made.num_rows))
    return made


@pytest.mark.filterwarnings("ignore:geom_path")
def test_figures_show_the_measures() -> None:
    tables = {name: named(name) for name in NAMES}
    drawn = layers(figures.life_courses(tables))["geom_line"]
    assert drawn["value"] == pytest.approx([5 / 3, 4.5, 4.0])
    assert drawn["minute"] == [1.0] * 3
    ages = figures.ages_at_death(tables)
    assert set(ages.data["reason"]) == {"age (1)", "no energy (1)"}
    assert ages.data["robots"].to_list() == [1, 1]
    drawn = layers(figures.ground_map(tables))
    assert drawn["geom_segment"]["first_x"] == [0.0, 0.0]
    assert max(drawn["geom_polygon"]["x"]) == pytest.approx(1.5)
    empty = {name: rows.slice(0, 0) for name, rows in tables.items()}
    for figure in (one for one in FIGURES if one.number in "MNO"):
        figure.drawn(tables).draw()
        with pytest.raises(NothingToDraw, match="rules of its own"):
            figure.drawn(empty)
