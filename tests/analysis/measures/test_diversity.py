"""Measures of diversity: by hand, by inclusion and exclusion, and against pyribs."""

import math
from itertools import combinations
from typing import Any

import numpy as np
import pyarrow as pa
import pytest

from analysis.measures.diversity.grids import Archive, cells, grid_measures, novelty
from analysis.measures.diversity.objectives import (
    added_volume,
    front,
    fronts,
    hypervolume,
)
from analysis.measures.populations import populations
from analysis.measures.run_tables import RunTables
from schema.experiment.document import (
    ArenaSection,
    Experiment,
    Measures,
    SelectionSection,
)
from schema.experiment.grid import Grid, cell_name
from tests.analysis.tables import births, population, run, table

GRID = Grid(("x", "y"), bounds=((0.0, 1.0), (0.0, 10.0)), bins=(2, 5), offset=-1.0)
A, B, C, D, E = ((0, number) for number in range(5))
F = (1, 0)


def evaluation(
    birth: tuple[int, int], fitness: float | None, *xy: float, **more: object
) -> dict[str, Any]:
    measures = list(zip("xy", xy, strict=False)) or None
    island, number = birth
    row = {"island": island, "birth_island": island, "birth": number}
    return {**row, "fitness": fitness, "measures": measures, **more}


def tables(**given: pa.Table) -> RunTables:
    names = Measures(names=("x", "y"))
    islands = [Experiment(name="e", births=9, measures=names, grid=GRID)]
    return RunTables(run(**given), islands=islands)


def test_scores_of_populations_by_hand() -> None:
    """C beats A in cell 0/0; D failed; F of island 1 came, and is not born here."""
    found = tables(
        births=births((A, []), (B, []), (C, [A, B]), (D, [C, A]), (F, [])),
        evaluations=table("evaluations", [
            evaluation(A, 1.0, 0.1, 1.0), evaluation(B, 3.0, 0.9, 9.0),
            evaluation(C, 2.0, 0.2, 0.0), evaluation(D, None),
            evaluation(F, 9.0, 0.9, 0.0), evaluation(F, 5.0, 0.9, 5.0, island=0),
            # Evaluated again: what counts is the evaluation at birth.
            evaluation(A, 7.0, 0.9, 9.0, trial=1),
        ]),
        population=population(
            (0, 2, {A: 1.0, B: 3.0}), (0, 4, {B: 3.0, C: 2.0, D: None, F: 5.0}),
            (1, 1, {F: 9.0}),
        ),
    )  # fmt: skip
    columns = {name: list(each) for name, each in grid_measures(found).items()}
    assert columns["coverage"] == pytest.approx([0.2, 0.2, 0.1])
    # Above -1: A 2 and B 4; C instead of A 3; F 10.
    assert columns["qd_score"] == pytest.approx([6, 7, 10])
    two_to_one = math.log(3) - 2 / 3 * math.log(2)
    assert columns["archive_entropy"] == pytest.approx([math.log(2), two_to_one, 0])
    # Boxes 0.1 x 0.1 x 2 and 0.9 x 0.9 x 4; C has nothing of y.
    assert columns["hypervolume"] == pytest.approx([3.24, 3.24, 0])
    # B from A; C, at (.2, 0), from both.
    apart = [math.hypot(0.8, 0.8), (math.hypot(0.1, 0.1) + math.hypot(0.7, 0.9)) / 2]
    assert columns["novelty"] == pytest.approx([*apart, np.nan], nan_ok=True)
    rows = cells(found).select(["island", "cell", "birth", "fitness", "robots"])
    assert [tuple(row.values()) for row in rows.to_pylist()] == [
        (0, "0/0", 2, 2.0, 2), (0, "1/4", 1, 3.0, 1), (1, "1/0", 0, 9.0, 1),
    ]  # fmt: skip


def test_arenas_count_the_first_sample_of_a_mature_robot() -> None:
    samples = [
        evaluation(A, 1.0, 0.1, 1.0, births=1, is_mature=False),
        evaluation(A, 2.0, 0.1, 1.0, births=2, is_mature=True),
        evaluation(A, 3.0, 0.9, 1.0, births=4, is_mature=True),
    ]
    found = tables(
        births=births((A, [])),
        fitness=table("fitness", samples),
        population=population(
            (0, 1, {A: None}), (0, 3, {A: 2.0}), (0, 4, {A: 3.0}), is_online=True
        ),
    )
    columns = grid_measures(found)
    assert columns["coverage"] == pytest.approx([0, 0.1, 0.1])
    assert columns["qd_score"] == pytest.approx([0, 3, 3])


@pytest.mark.parametrize("islands", [[], [Experiment(name="e", arena=ArenaSection())]])
def test_without_a_grid_there_are_no_such_measures(islands: list[Experiment]) -> None:
    assert grid_measures(RunTables(run(births=births((A, []))), islands=islands)) == {}


def test_branches_of_first_parents() -> None:
    """E, B of A, and D of C of B: A-B, B-C, C-D, as E is a founder; B joined by E."""
    found = RunTables(
        run(
            births=births((A, []), (B, [A]), (C, [B, E]), (D, [C, E]), (E, [])),
            population=population(
                (0, 2, {A: 1, B: 1}), (0, 5, {B: 1, D: 1, E: 1}), (0, 6, {E: 1})
            ),
        )
    )
    columns, _ = populations(found)
    assert columns["phylogenetic_diversity"].to_pylist() == [1, 3, 0]


def test_novelty_is_the_mean_distance_to_the_five_nearest_earlier_births() -> None:
    """The seventh of a row of places 1 apart is 1 to 5 from five, and 6 from one."""
    places = np.arange(7.0)[:, np.newaxis]
    wanted = [np.nan, 1, 1.5, 2, 2.5, 3, 3]
    assert novelty(places) == pytest.approx(np.array(wanted), nan_ok=True)


def union(boxes: Any) -> float:  # noqa: ANN401
    """Return the volume of boxes from 0 on, by inclusion and exclusion."""
    volumes = (
        (-1) ** (size + 1) * float(np.prod(np.min(chosen, axis=0)))
        for size in range(1, len(boxes) + 1)
        for chosen in combinations(boxes, size)
    )
    return sum(volumes, 0.0)


@pytest.mark.parametrize("objectives", [2, 3, 4])
def test_hypervolume_is_that_of_the_boxes(objectives: int) -> None:
    rng = np.random.default_rng(objectives)
    # Of few values, so that some are equal.
    points = rng.integers(0, 6, (8, objectives)).astype(float)
    assert hypervolume(points) == pytest.approx(union(points))
    kept = front(points)
    assert not any(
        (other >= point).all() and (other > point).any()
        for point in kept
        for other in points
    )
    assert union(kept) == pytest.approx(union(points))
    for point in points:
        alone = [other for other in kept if (other >= point).all()]
        assert alone
    new = np.full(objectives, 4.0)
    more = union(np.vstack([points, new])) - union(points)
    assert added_volume(kept, new) == pytest.approx(more)


def test_less_of_a_minimised_measure_dominates_more() -> None:
    archive = Archive(Grid(("x",), bounds=((0, 10),), bins=(2,), minimised=("x",)))
    for index, value in enumerate((4.0, 9.0)):
        archive.add(index, 1.0 + index, np.array([value]))
    # Boxes 0.6 x 1 and 0.1 x 2.
    assert archive.scores[-1] == pytest.approx(0.7)


@pytest.mark.parametrize("key", ["parents", "survivors"])
def test_fronts_are_those_of_the_objectives(key: str) -> None:
    """B has less of x than A and is fitter; C is on the front; D failed."""
    objectives = {"objectives": {"x": "min", "fitness": "max"}}
    section: dict[str, Any] = {key: "nsga2", f"{key}_parameters": objectives}
    selection = SelectionSection(**section)
    found = RunTables(
        run(
            births=births((A, []), (B, []), (C, []), (D, [])),
            evaluations=table("evaluations", [
                evaluation(A, 1.0, 0.5), evaluation(B, 2.0, 0.4),
                evaluation(C, 3.0, 0.6), evaluation(D, None),
            ]),
        ),
        islands=[Experiment(name="e", selection=selection)],
    )  # fmt: skip
    rows = fronts(found).drop_columns(["island", "birth_island"]).to_pylist()
    assert [tuple(row.values()) for row in rows] == [
        (birth, "x (min)", "fitness (max)", x, fitness, is_front)
        for birth, x, fitness, is_front in (
            (0, 0.5, 1.0, False), (1, 0.4, 2.0, True), (2, 0.6, 3.0, True),
        )
    ]  # fmt: skip


@pytest.mark.long
@pytest.mark.parametrize("measures", [1, 2, 4])
def test_archives_are_those_of_pyribs(measures: int) -> None:
    archives = pytest.importorskip("ribs.archives")
    names = tuple("abcd"[:measures])
    bins = (10, 7, 3, 2)[:measures]
    bounds = ((0.0, 1.0), (-1.0, 1.0), (3.0, 31.0), (0.0, 0.3))[:measures]
    grid = Grid(names, bounds=bounds, bins=bins, offset=-0.5)
    own = Archive(grid)
    other = archives.GridArchive(
        solution_dim=1, dims=bins, ranges=bounds, qd_score_offset=-0.5
    )
    rng = np.random.default_rng(1)
    low, high = np.array(bounds).T
    for index in range(3000):
        # Tenths: many lie on bounds of cells, and some fitness is equal.
        share = rng.integers(-2, 13, measures) / 10
        fitness = float(rng.integers(0, 50)) / 100
        values = low + share * (high - low)
        own.add(index, fitness, values)
        other.add_single([index], fitness, values)
    coverage, score, *_ = own.scores
    assert coverage == pytest.approx(other.stats.coverage)
    assert score == pytest.approx(other.stats.qd_score)
    place_of = {
        cell_name(tuple(cell)): int(index)
        for cell, index in zip(
            other.int_to_grid_index(other.data("index")).tolist(),
            other.data("solution")[:, 0],
            strict=True,
        )
    }
    assert {
        cell_name(cell): index for cell, (index, _) in own.elites.items()
    } == place_of
