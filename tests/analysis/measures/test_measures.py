"""Tests of all measures, with small tables and known results."""

import math
from typing import Any, Literal

import numpy as np
import pyarrow as pa
import pytest

from analysis.comparison.progression import progression
from analysis.measures.ancestry import ancestors, parents_of
from analysis.measures.arenas import interactions, variability
from analysis.measures.bodies import body_sizes, encode, extremity_bins
from analysis.measures.diversity.distances import diversity
from analysis.measures.islands import mean_distances, migrants
from analysis.measures.measures import births_so_far, measure, robots
from analysis.measures.outputs import schema
from analysis.measures.population_table import population_table
from analysis.measures.populations import populations, retention
from analysis.measures.run_tables import RunTables
from schema.errors import RunFolderError
from schema.experiment.document import (
    ArenaSection,
    Experiment,
    Reevaluation,
    SelectionSection,
)
from tests.analysis.bodies import Body, part
from tests.analysis.tables import CORE, births, population, run, table

A, B, C, D, E = ((0, number) for number in range(5))
FAMILY = births((A, []), (B, []), (C, [A, B]), (D, [C, A]), (E, [D, C]))
"""A and B are founders, C their child, D that one's and A's, E a child of both."""


F, G, H = (1, 0), (1, 1), (1, 2)
ISLANDS = births((A, []), (B, []), (F, []), (C, [A, B]), (G, [F, A]), (H, [G]))
"""On island 1, G has a parent on island 0; H is its child."""


def column(tables: dict[str, pa.Table], name: str) -> list[Any]:
    found, problems = populations(RunTables(tables))
    assert not problems
    values: list[Any] = found[name].to_pylist()
    return values


BY_HAND: dict[str, tuple[pa.Table, pa.Table, dict[str, list[Any]]]] = {
    "a failed evaluation is a fitness of 0 off-line, as it is in selection": (
        FAMILY,
        population((0, 2, {A: 0.1, B: 0.3}), (0, 4, {A: 0.5, C: None, D: 0.4})),
        {"births": [2, 4], "size": [2, 3], "judged": [2, 3], "fitness": [0.2, 0.3],
         "fitness_best": [0.3, 0.5], "foreign": [None, None]},
    ),
    "immature robots of an arena are not judged": (
        births((A, []), (B, []), (D, [A, B]), rank=[1, 1, 2]),
        population((0, 1, {A: None}), (0, 4, {A: 0.2, B: None, D: 0.4}),
                   is_online=True),
        {"size": [1, 3], "judged": [0, 2], "fitness": [None, 0.3],
         "fitness_best": [None, 0.4], "rank": [None, 1.5]},
    ),
    # D descends from A, B, C; E from D besides: 4 of 2 robots.
    "each ancestor is counted once": (
        FAMILY,
        population((0, 2, {A: 0.1, B: 0.3}), (0, 3, {B: 0.3, C: 0.3}),
                   (0, 5, {D: 0.3, E: 0.3})),
        {"ancestors": [0, 2, 4], "ancestors_per_robot": [0, 1, 2]},
    ),
    "ancestors of immature robots do not count": (
        FAMILY,
        population((0, 5, {C: 0.1, E: None}), is_online=True),
        {"ancestors": [2], "ancestors_per_robot": [2]},
    ),
    # A of island 0 descends from G of island 1, and that one from F.
    "a parent's row may come after its child's": (
        births((A, [G]), (F, []), (G, [F])),
        population((0, 1, {A: 1}), (1, 2, {F: 1, G: 1})),
        {"ancestors": [2, 1], "foreign": [1, 0]},
    ),
    "robots of other islands and their descendants are foreign": (
        ISLANDS,
        population((0, 2, {A: 1, B: 1}), (0, 3, {B: 1, C: 1}), (1, 1, {F: 1}),
                   (1, 2, {F: 1, A: 1, G: 1}), (1, 3, {F: 1, G: 1, H: 1})),
        {"foreign": [0, 0, 0, 2 / 3, 2 / 3]},
    ),
    "where all have failed there is no fitness": (
        FAMILY,
        population((0, 3, {A: None, B: None})),
        {"fitness": [None], "fitness_best": [None]},
    ),
}  # fmt: skip


@pytest.mark.parametrize(("born", "living", "expected"), BY_HAND.values(), ids=BY_HAND)
def test_measures_of_populations_by_hand(
    born: pa.Table, living: pa.Table, expected: dict[str, list[Any]]
) -> None:
    tables = run(births=born, population=living)
    for name, values in expected.items():
        assert column(tables, name) == [
            value if value is None else pytest.approx(value) for value in values
        ], name


def test_an_individual_that_is_its_own_ancestor_is_refused() -> None:
    with pytest.raises(RunFolderError, match="row 0 descends from itself"):
        ancestors(parents_of(births((A, [B]), (B, [A]))))


def test_a_missing_parent_is_reported_and_other_measures_remain() -> None:
    tables = run(
        births=births((A, []), (C, [A, B])), population=population((0, 2, {A: 1, C: 2}))
    )
    with pytest.raises(RunFolderError, match="row 1 has a parent whose birth is not"):
        parents_of(tables["births"])
    found, problems = measure(RunTables(tables))
    assert found["populations"]["fitness"].to_pylist() == [1.5]
    assert found["populations"]["ancestors"].to_pylist() == [None]
    assert {"ancestors", "foreign", "robots"} <= set(problems)


BRICK: Body = [*CORE, part(1, 0, 0, "FixedBrick")]
HINGE: Body = [*CORE, part(1, 0, 0, "ActiveHinge")]
FAR: Body = [*CORE, part(1, 0, 2, "Hinge"), part(2, 1, 1, "Hinge")]


def test_diversity_is_the_mean_over_pairs() -> None:
    # Core to brick 1, core to hinge 1, brick to hinge 1, core to far 2, brick to far
    # 1 + 2 (type and slot differ, one more part), hinge to far the same.
    bodies = births((A, []), (B, []), (C, []), (D, []), body=[CORE, BRICK, HINGE, FAR])
    living = population(
        (0, 2, {A: 0.1}),
        (0, 3, {A: 0.1, B: None, C: 0.1}),
        (0, 4, {A: 0.1, B: 0.1, C: 0.1, D: None}),
        is_online=True,
    )
    found = diversity(population_table(living, bodies), encode(bodies["body"]))
    assert math.isnan(found[0])
    assert found[1:].tolist() == pytest.approx([1.0, (1 + 1 + 1 + 2 + 3 + 3) / 6])


def test_retention_is_the_share_that_is_still_alive() -> None:
    born = births(*((name, []) for name in (A, B, C, D, E)))
    living = population(
        (0, 10, {A: 1, B: 1, C: 1, D: 1}),
        # Nothing was recorded at 130 + 5: skipped, and so are the last.
        (0, 15, {A: 1, E: 1}),
        (0, 130, {B: 1, D: 1, E: None}),
        (0, 250, {B: 1}),
        # Another island's do not count, though they bear the same names.
        (1, 130, {A: 1}),
    )
    found = retention(population_table(living, born)).tolist()
    nan = math.nan
    assert found == pytest.approx([0.5, nan, 1 / 3, nan, nan], nan_ok=True)
    assert retention(population_table(living, born), step=5)[0] == 0.25


def test_variability_by_hand() -> None:
    rows = [
        # (robot, second, fitness, mature): C is never compared with anybody.
        (0, 5, 0.9, False),
        (0, 10, 0.1, True),
        (1, 10, 0.2, True),
        (0, 15, 0.4, True),
        (1, 15, 0.6, True),
        (0, 20, 0.2, True),
        (1, 20, 0.1, True),
        (1, 25, 1.1, True),
        (2, 25, 0.3, True),
    ]
    samples = [
        {"birth": birth, "sim_time_s": time, "fitness": fitness, "is_mature": mature}
        for birth, time, fitness, mature in rows
    ]
    found = variability(RunTables(run(fitness=table("fitness", samples)))).to_pylist()
    assert [(row["birth"], row["samples"]) for row in found] == [(0, 3), (1, 4)]
    # While 0 lived, fitness ran from 0.1 to 0.6; while 1 did, from 0.1 to 1.1.
    assert [row["fitness_range"] for row in found] == pytest.approx([0.3, 1.0])
    assert [row["population_range"] for row in found] == pytest.approx([0.5, 1.0])
    assert [row["variability"] for row in found] == pytest.approx([0.6, 1.0])


def test_sizes_by_hand() -> None:
    body = [
        *CORE,
        part(1, 0, 0, "ActiveHinge"),
        part(2, 1, 1, "TouchSensor"),
        part(3, 0, 1, "Hinge"),
        part(4, 3, 1, "TouchSensor"),
    ]
    born = births(
        (A, []), (B, []), body=[body, CORE], parts=[5, 1], joints=[2, 0],
        motors=[1, 0], extremities=[2, 1], hidden=[3, 0], connections=[10, 1],
    )  # fmt: skip
    found = {name: values.tolist() for name, values in body_sizes(born).items()}
    counts = {
        "parts": [5, 1], "active_joints": [1, 0], "passive_joints": [1, 0],
        "joints": [2, 0], "extremities": [2, 1], "touch_sensors": [2, 0],
        "hidden": [3, 0], "connections": [10, 1],
    }  # fmt: skip
    assert found == counts | {
        f"{name}_per_part": [first / 5, last]
        for name, (first, last) in counts.items()
        if name not in {"parts", "touch_sensors"}
    }
    tables = run(births=born, population=population((0, 2, {A: 0.1, B: 0.3})))
    assert column(tables, "parts") == [3]
    assert column(tables, "extremities_per_part") == [pytest.approx(0.7)]
    assert column(tables, "touch_sensors") == [1]
    assert column(tables, "without_touch") == [0.5]


def evaluated(*rows: tuple[int, int, float | None]) -> pa.Table:
    """Return evaluations: birth, trial and fitness, None of a failed one."""
    names = ("birth", "trial", "fitness")
    return table("evaluations", [dict(zip(names, row, strict=True)) for row in rows])


def test_robots_have_their_last_fitness() -> None:
    tables = run(
        births=FAMILY,
        population=population((0, 3, {A: 0.1, B: None}), (0, 5, {A: 0.2, C: 0.3})),
        evaluations=evaluated((0, 0, 0.1), (1, 0, None), (2, 0, 0.3), (0, 1, 0.2)),
    )
    names = ["birth", "fitness", "is_last", "ancestors", "is_failed"]
    assert [
        [*row.values()] for row in robots(RunTables(tables)).select(names).to_pylist()
    ] == [[0, 0.2, True, 0, False], [1, 0.0, False, 0, True], [2, 0.3, True, 2, False]]


def test_a_failure_counts_as_the_least_fitness_below_0() -> None:
    tables = run(
        births=FAMILY,
        population=population((0, 3, {A: -0.2, B: None}), (0, 4, {A: 0.5, B: None})),
        evaluations=evaluated(
            (0, 0, -0.2), (1, 0, None), (2, 0, 0.3), (3, 0, -0.6), (3, 1, None)
        ),
    )
    assert column(tables, "fitness") == [-0.2, 0.25]
    assert column(tables, "fitness_best") == [-0.2, 0.5]
    # A and B as in their last population, D with the mean of -0.6 and -0.6.
    found = robots(RunTables(tables, islands=rejudged("mean")))
    assert found["fitness"].to_pylist() == [0.5, 0.0, 0.3, -0.6]


def rejudged(rule: Literal["replace", "mean"]) -> tuple[Experiment]:
    """Return the settings of an island that evaluates robots again."""
    again = SelectionSection(reevaluation=Reevaluation(fitness=rule))
    return (Experiment("e", births=5, selection=again),)


@pytest.mark.parametrize(
    ("rule", "expected"),
    [("replace", [0.3, 0.4, 0.0, 0.5, 0.3]), ("mean", [0.2, 0.2, 0.0, 0.5, 0.3])],
)
def test_robots_have_the_mean_of_their_evaluations_if_selection_takes_it(
    rule: Literal["replace", "mean"], expected: list[float]
) -> None:
    """A, B and C are dead; a failed evaluation of B counts as 0, D lives.

    On island 1, an immigrant is judged each time that it arrives: the last one counts.
    """
    here = evaluated(
        (0, 0, 0.1), (1, 0, None), (2, 0, None), (3, 0, 0.9),
        (0, 1, 0.3), (1, 1, 0.4), (2, 1, None), (3, 1, 0.1),
    )  # fmt: skip
    there: list[dict[str, Any]] = [
        {"island": 1, "birth_island": 0, "birth": 4, "fitness": fitness}
        for fitness in (0.7, 0.3)
    ]
    tables = run(
        births=FAMILY,
        population=population((0, 5, {D: 0.5})),
        evaluations=pa.concat_tables([here, table("evaluations", there)]),
    )
    found = robots(RunTables(tables, islands=rejudged(rule)))
    assert found["fitness"].to_pylist() == pytest.approx(expected)
    failed = [False, False, True, False, False]
    assert found["is_failed"].to_pylist() == failed


def test_of_several_islands_the_greatest_of_the_last_fitness_counts() -> None:
    evaluations: list[dict[str, Any]] = [
        {"island": 0, "birth": 0, "trial": 0, "fitness": 0.9},
        {"island": 0, "birth": 0, "trial": 1, "fitness": 0.15},
        {"island": 1, "birth": 0, "trial": 0, "fitness": 0.11, "birth_island": 0},
        {"island": 0, "birth": 3, "fitness": 0.5},
        {"island": 1, "birth": 3, "fitness": 0.5, "birth_island": 0},
        {"island": 1, "birth": 1, "trial": 0, "fitness": 0.2, "birth_island": 0},
        {"island": 0, "birth": 1, "trial": 0, "fitness": None},
    ]
    samples = [
        # Clocks of islands cannot be compared.
        {"island": 2, "birth": 2, "sim_time_s": 99.0, "fitness": 0.3},
        {"island": 1, "birth": 2, "sim_time_s": 20.0, "fitness": 0.4},
    ]
    samples = [{**each, "birth_island": 0, "is_mature": True} for each in samples]
    living = population((0, 5, {A: 0.15}), (1, 3, {A: 0.11, B: 0.2}), (1, 2, {A: 7.0}))
    tables = run(
        births=FAMILY,
        population=living,
        evaluations=table("evaluations", evaluations),
        fitness=table("fitness", samples),
    )
    found = robots(RunTables(tables))
    assert found["birth"].to_pylist() == [0, 1, 2, 3]
    assert found["fitness"].to_pylist() == [0.15, 0.2, 0.4, 0.5]
    assert found["island"].to_pylist() == [0, 1, 1, 0]
    assert found["is_last"].to_pylist() == [True, True, False, False]
    assert not any(found["is_failed"].to_pylist())


def test_births_so_far_are_in_the_order_of_birth_on_each_island() -> None:
    rows = [
        {"island": 0, "birth": birth, "sim_time_s": time_s}
        for birth, time_s in enumerate((2.0, 1.0, 0.0, 15.0, 15.0))
    ] + [{"island": 1, "birth": birth, "sim_time_s": None} for birth in range(3)]
    born = pa.Table.from_pylist(rows)
    assert births_so_far(born).tolist() == [3, 2, 1, 4, 5, 1, 2, 3]


def test_robots_of_an_arena_count_if_they_were_ever_mature() -> None:
    samples = [
        {"birth": 0, "sim_time_s": 20.0, "fitness": 0.2, "is_mature": True},
        {"birth": 0, "sim_time_s": 15.0, "fitness": 0.1, "is_mature": True},
        {"birth": 1, "sim_time_s": 20.0, "fitness": 0.9, "is_mature": False},
    ]
    living = population(
        (0, 1, {A: 0.3}), (0, 2, {A: 0.15, B: None}), is_online=True
    )  # fmt: skip
    tables = run(births=FAMILY, population=living, fitness=table("fitness", samples))
    (row,) = robots(RunTables(tables)).to_pylist()
    # Alive at the last birth: as it was judged then.
    assert (row["birth"], row["fitness"], row["is_last"]) == (0, 0.15, True)
    assert row["fitness_max"] == 0.3


def test_extremities_against_fitness() -> None:
    made = pa.table(
        {
            "is_last": [True, True, False, False],
            "parts": [10, 10, 20, 3],
            "extremities": [3, 3, 6, 1],
            "fitness": [0.1, 0.3, 0.5, 0.7],
        }
    )
    found = [tuple(row.values()) for row in extremity_bins(made).to_pylist()]
    assert found == [
        ("final", "count", 3, 2, pytest.approx(0.2)),
        ("final", "per_part", 0.3, 2, pytest.approx(0.2)),
        ("born", "count", 1, 1, 0.7),
        ("born", "count", 3, 2, pytest.approx(0.2)),
        ("born", "count", 6, 1, 0.5),
        ("born", "per_part", 0.3, 4, pytest.approx(0.4)),
    ]


def test_interactions_by_hand() -> None:
    born = births(
        (A, []), (B, []), (C, []), (D, []), sim_time_s=[0.0, 10.0, 20.0, None]
    )
    deaths = table("deaths", [{"birth": 0, "sim_time_s": 40.0}])
    touches = [
        {"birth": 0, "other_island": 0, "other_birth": 1, "over_s": 1.0,
         "sim_time_s": time_s, "duration_s": duration_s}
        for time_s, duration_s in ((30.0, 0.5), (31.0, 1.0))
    ]  # fmt: skip
    samples = table("fitness", [{"birth": 1, "sim_time_s": 60.0}])
    tables = run(births=born, population=population((0, 3, {B: None}), is_online=True))
    tables |= {"deaths": deaths, "fitness": samples}
    tables["touches"] = table("touches", touches)
    (row,) = interactions(RunTables(tables)).to_pylist()
    # A lived 40 s, B 50 s and C 40 s, to the last sample; D off-line.
    assert row == {
        "island": 0,
        "robots": 3,
        "lived_s": 130.0,
        "pairs": 1,
        "touched": pytest.approx(2 / 3),
        "touching": pytest.approx(3.0 / 130.0),
    }


def test_migrants_and_their_descendants() -> None:
    living = population(
        (0, 2, {A: 1, B: 1}),
        (0, 3, {B: 1, C: 1}),
        (1, 1, {F: 1}),
        (1, 2, {F: 1, A: 1, G: 1}),
        (1, 3, {F: 1, G: 1, H: 1}),
    )
    moved = table(
        "migrations",
        [
            {"island": 0, "to": 1, "epoch": 1, "birth": 0, "fitness": 0.5},
            {"island": 1, "to": 0, "epoch": 1, "birth": 0, "fitness": None},
        ],
    )
    tables = run(births=ISLANDS, population=living, migrations=moved)
    found = migrants(RunTables(tables))
    names = ["birth_island", "descendants", "living", "reached"]
    # A has G and H on island 1, where both live, and C at home.
    expected = [[0, 2, 2, 2], [1, 0, 0, 1]]
    assert [[*row.values()] for row in found.select(names).to_pylist()] == expected


def test_distances_between_islands() -> None:
    bodies = [CORE, BRICK, FAR, HINGE, CORE, CORE]
    born = births((A, []), (B, []), (F, []), (C, []), (G, []), (H, []), body=bodies)
    living = population(
        (0, 2, {A: 1, B: 1}), (1, 1, {F: 1}), (0, 4, {B: 1, C: 1}), (1, 3, {F: 1, G: 1})
    )
    tables = run(births=born, population=living)
    found = mean_distances(RunTables(tables), step=2).to_pylist()
    # At 2: core and brick here, far there: (2 + 3) / 2; within only here: 1.
    assert found[0] == {"births": 2, "islands": 2, "within": 1.0, "between": 2.5}
    # At 4: brick and hinge; far and core: 3, 1, 3, 1; within: 1 and 2.
    assert found[1] == {"births": 4, "islands": 2, "within": 1.5, "between": 2.0}


def progressed(*rows: tuple[str, str, int, int, float]) -> list[dict[str, Any]]:
    """Return the progression of rows: experiment, folder, island, births, fitness."""
    names = ("experiment", "folder", "island", "births", "fitness")
    made = [dict(zip(names, row, strict=True)) for row in rows]
    found = progression(pa.Table.from_pylist(made, schema("populations")))
    assert {*found["measure"].to_pylist()} == {"fitness"}
    rows_found: list[dict[str, Any]] = found.to_pylist()
    return rows_found


def test_progression_of_two_runs_and_of_another_experiment() -> None:
    found = progressed(
        ("a", "x", 0, 15, 0.2),
        ("a", "y", 0, 15, 0.4),
        ("a", "x", 0, 30, 0.4),
        ("b", "z", 0, 15, 0.25),
    )
    assert [(row["experiment"], row["births"], row["runs"]) for row in found] == [
        ("a", 15, 2),
        ("a", 30, 1),
        ("b", 15, 1),
    ]
    assert [row["mean"] for row in found] == pytest.approx([0.3, 0.4, 0.25])
    assert (found[0]["least"], found[0]["greatest"]) == (0.2, 0.4)
    # Standard error 0.1, and Student's t of one degree of freedom is 12.706.
    assert found[0]["low"] == pytest.approx(0.3 - 1.2706, abs=1e-4)
    assert found[0]["high"] == pytest.approx(0.3 + 1.2706, abs=1e-4)
    assert found[1]["low"] is None


def test_progression_of_islands_has_births_at_which_all_are_recorded() -> None:
    rows = [(0, 15, 0.2), (1, 15, 0.4), (1, 16, 0.9), (0, 30, 0.4), (1, 30, 0.8)]
    found = progressed(*(("a", "a", *row) for row in rows))
    assert [row["births"] for row in found] == [15, 30]
    assert [row["mean"] for row in found] == pytest.approx([0.3, 0.6])


def test_a_run_without_births_has_no_measures() -> None:
    tables = run(births=births(), population=population())
    island = Experiment("e", arena=ArenaSection(record_touches=True))
    found, problems = measure(RunTables(tables, islands=[island] * 2))
    assert {"variability", "interactions", "between", "migrants"} < set(found)
    assert not problems
    assert {rows.num_rows for rows in found.values()} == {0}
    empty = population_table(tables["population"], tables["births"])
    assert empty.mean(np.zeros(0)).size == 0
